"""A new cell out of units, wires and switches that a person chose: TOML as a person would write it."""

import re
from collections.abc import Callable
from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from detent.cell.build import build
from detent.cell.description import Problem, parse
from detent.cell.parts import PARTS
from detent.controllers import catalogue
from detent.motors.motor import MotorError
from detent.pins import PinKind

MOST: Final = 40  # of each kind
BARE: Final = re.compile(r"[A-Za-z0-9_-]+")

Text = Annotated[str, Field(max_length=120)]


class _Chosen(BaseModel):
    model_config = ConfigDict(extra="forbid")


class NewUnit(_Chosen):
    """A unit: its name and model, straps that are not as the model has them, a program in a file beside the cell."""

    name: Text
    model: Text
    straps: Annotated[dict[Text, Literal["low", "high"]], Field(max_length=MOST)] = {}
    program: Text = ""


class NewMotor(_Chosen):
    """A motor on the axis of a unit (`axis` "" where it has one): its name in the list, its supply in V, its lead."""

    unit: Text
    axis: Text = ""
    motor: Text
    supply: Annotated[float, Field(gt=0, le=1000)] = 24
    lead: Annotated[float, Field(allow_inf_nan=False)] | None = None


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
    motors: Annotated[list[NewMotor], Field(max_length=MOST)] = []

    def text(self, read: Callable[[str], str] | None = None) -> str:
        """The cell file. Raises ValueError with what is wrong, and what to do. `read` gives the text of a program."""
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
            lines += [f"[units.{_key(unit.name)}]", f"model = {_string(unit.model)}"]
            if unit.straps:
                tied = ", ".join(f"{_key(pin)} = {_string(level)}" for pin, level in unit.straps.items())
                lines.append(f"straps = {{ {tied} }}")
            lines += [f"program = {_string(unit.program)}"] * bool(unit.program) + [""]
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
        for motor in self.motors:
            name = f"{motor.unit}_{motor.axis}" if motor.axis else f"{motor.unit}_motor"
            lines += [f"[motors.{_key(name)}]", f"unit = {_string(motor.unit)}"]
            lines += [f"axis = {_string(motor.axis)}"] * bool(motor.axis)
            lines += [f"motor = {_string(motor.motor)}", f"supply = {_number(motor.supply)}"]
            lines += ([] if motor.lead is None else [f"lead = {_number(motor.lead)}"]) + [""]
        text = "\n".join(lines).rstrip() + "\n"
        try:
            build(parse(text, "the new cell"), read or _no_file)
        except OSError as error:
            raise ValueError(f"a program cannot be read: {error}") from None
        except (Problem, MotorError) as error:
            raise ValueError(str(error)) from None
        return text


def jacks() -> dict[str, dict[str, list[str]]]:
    """For each model, parts too, what a wire can lead from (``out``) and to (``in``), and its ``straps``."""
    models: dict[str, catalogue.Configurable] = {**catalogue.MODELS, **PARTS}
    fits: dict[str, Callable[[PinKind], bool]] = {
        "in": lambda kind: kind.reads and kind not in (PinKind.STRAP, PinKind.SERIAL),
        "out": lambda kind: kind in (PinKind.OUTPUT, PinKind.OPEN_COLLECTOR),
    }
    return {
        name: {side: [pin.name for pin in found.pins if fit(pin.kind)] for side, fit in fits.items()}
        | {"straps": list(found.straps)}
        for name, found in models.items()
    }


def _no_file(name: str) -> str:
    raise ValueError(f"a new cell names no files, and not {name}")


def _key(name: str) -> str:
    return name if BARE.fullmatch(name) else _string(name)


def _string(text: str) -> str:
    return '"' + re.sub(r'[\x00-\x1f\x7f"\\]', lambda found: f"\\u{ord(found[0]):04X}", text) + '"'


def _number(value: float) -> str:
    short = f"{value:g}"
    return short if float(short) == value else repr(value)


def _strings(texts: list[str]) -> str:
    return _string(texts[0]) if len(texts) == 1 else f"[{', '.join(map(_string, texts))}]"
