"""A new cell out of units, wires and switches that a person chose: TOML as a person would write it."""

import re
from collections.abc import Callable, Mapping
from typing import Annotated, Final

from pydantic import BaseModel, ConfigDict, Field

from detent.cell.build import build
from detent.cell.description import Problem, parse
from detent.cell.parts import PARTS
from detent.controllers import catalogue
from detent.pins import Pin, PinKind

MOST: Final = 40  # of each kind
BARE: Final = re.compile(r"[A-Za-z0-9_-]+")

Text = Annotated[str, Field(max_length=120)]


class _Chosen(BaseModel):
    model_config = ConfigDict(extra="forbid")


class NewUnit(_Chosen):
    """A unit: its name and its model."""

    name: Text
    model: Text


class NewWire(_Chosen):
    """A wire from an output to an input, each UNIT.PIN."""

    source: Text
    target: Text


class NewSwitch(_Chosen):
    """A switch on the panel, the input that it drives, and its level when the cell starts."""

    name: Text
    drives: Text
    level: Annotated[int, Field(ge=0, le=1)] = 0


class NewCell(_Chosen):
    """What was chosen."""

    title: Text = ""
    units: Annotated[list[NewUnit], Field(max_length=MOST)]
    wires: Annotated[list[NewWire], Field(max_length=4 * MOST)] = []
    switches: Annotated[list[NewSwitch], Field(max_length=MOST)] = []

    def text(self) -> str:
        """The cell file. Raises ValueError with what is wrong, and what to do."""
        if not self.units:
            raise ValueError("a cell has at least one unit: add one")
        for kind, names in (
            ("unit", [one.name for one in self.units]),
            ("switch", [one.name for one in self.switches]),
        ):
            twice = next((name for name in names if names.count(name) > 1), None)
            if twice is not None:
                raise ValueError(f"there are two {kind}s {twice!r}: give one of them another name")
        lines = [f"title = {_string(self.title)}", ""] if self.title else []
        for unit in self.units:
            lines += [f"[units.{_key(unit.name)}]", f"model = {_string(unit.model)}", ""]
        targets: dict[str, list[str]] = {}
        for wire in self.wires:
            targets.setdefault(wire.source, []).append(wire.target)
        for source, to in targets.items():
            lines += ["[[wires]]", f"from = {_string(source)}", f"to = {_strings(to)}", ""]
        for switch in self.switches:
            lines += [
                f"[switches.{_key(switch.name)}]",
                f"drives = {_string(switch.drives)}",
                f"level = {switch.level}",
                "",
            ]
        text = "\n".join(lines).rstrip() + "\n"
        try:
            build(parse(text, "the new cell"), _no_file)
        except Problem as error:
            raise ValueError(str(error)) from None
        return text


def jacks() -> dict[str, dict[str, list[str]]]:
    """For each model, parts too, what a wire can lead from (``out``) and to (``in``)."""
    models: Mapping[str, tuple[Pin, ...]] = {
        **{name: model.pins for name, model in catalogue.MODELS.items()},
        **{name: part.pins for name, part in PARTS.items()},
    }
    fits: dict[str, Callable[[PinKind], bool]] = {
        "in": lambda kind: kind.reads and kind not in (PinKind.STRAP, PinKind.SERIAL),
        "out": lambda kind: kind in (PinKind.OUTPUT, PinKind.OPEN_COLLECTOR),
    }
    return {
        name: {side: [pin.name for pin in pins if fit(pin.kind)] for side, fit in fits.items()}
        for name, pins in models.items()
    }


def _no_file(name: str) -> str:
    raise ValueError(f"a new cell names no files, and not {name}")


def _key(name: str) -> str:
    return name if BARE.fullmatch(name) else _string(name)


def _string(text: str) -> str:
    return '"' + re.sub(r'[\x00-\x1f\x7f"\\]', lambda found: f"\\u{ord(found[0]):04X}", text) + '"'


def _strings(texts: list[str]) -> str:
    return _string(texts[0]) if len(texts) == 1 else f"[{', '.join(map(_string, texts))}]"
