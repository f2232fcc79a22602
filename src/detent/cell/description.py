"""A cell as its TOML file describes it, checked for form; `build` checks it for sense.

Every fault becomes a `Problem`: one line with the file, the key and what to do. Reading files is the caller's
business; this module is given text. What checks a file (pydantic) is loaded when there is one: a unit by itself needs
none of it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from detent import toml
from detent.one_line import one_line

if TYPE_CHECKING:
    from typing import Annotated

    from pydantic import BeforeValidator

    from detent.cell.fields import Name, Number, Steps
    from detent.cell.hardware import Board, Hardware, by_axis
    from detent.cell.tables import Line, Motor, ScriptEntry, Switch, Wire

MOST_PROBLEMS = 5

Kind = TypeVar("Kind")


class Problem(ValueError):
    """Something wrong with a cell, a program or a choice. `str` is one line: file, key, what, remedy."""

    def __init__(self, file: str, key: str, message: str) -> None:
        self.file, self.key, self.message = file, one_line(key), one_line(message)
        super().__init__(": ".join(part for part in (file, self.key, self.message) if part))


@dataclass(frozen=True, kw_only=True)
class Unit:
    """``[units.NAME]``: a controller, or another part with pins."""

    __pydantic_config__: ClassVar[Mapping[str, object]] = {"extra": "forbid", "allow_inf_nan": False}

    model: str
    """A controller (`detent models`), or a [part](#parts) that is none."""
    program: str | None = None
    """A file, put into program memory and started when the cell starts, as a host would."""
    eeprom: str | None = None
    """A file with what the EEPROM holds when the cell starts; with `serve`, an image that was kept goes before it."""
    straps: "dict[str, Steps | str]" = field(default_factory=dict)
    """Levels of strap pins; `open` too. Those that are not named are as the manual has them."""
    options: "dict[str, Steps | Number | str]" = field(default_factory=dict)
    """What no pin decides, by name."""
    powered: bool = True
    """Whether the supply is on when the cell starts."""
    shaft: "Steps" = 0
    """Steps: where the axis stands when the cell starts, for switches on it; the counter of the controller begins at
    0 all the same."""
    supply: "Number | None" = None
    """V: refused if the model's manual does not allow it."""
    loads: "dict[str, Number]" = field(default_factory=dict)
    """A by pin: currents drawn from the supply outputs, refused if they are more than the manual allows."""


@dataclass(frozen=True, kw_only=True)
class Description:
    """A whole cell file. `file` is its name in error messages."""

    __pydantic_config__: ClassVar[Mapping[str, object]] = {"extra": "forbid", "allow_inf_nan": False}

    title: str = ""
    """Heads figures and stories."""
    units: "dict[Name, Unit]"
    """What stands in the cell: `[units.NAME]`."""
    wires: "list[Wire]" = field(default_factory=list)
    """Which output leads to which input: `[[wires]]`."""
    switches: "dict[Name, Switch]" = field(default_factory=dict)
    """Contacts, set by the script or moved by an axis: `[switches.NAME]`."""
    motors: "dict[Name, Motor]" = field(default_factory=dict)
    """Motors with drive and load on the axes: `[motors.NAME]`."""
    lines: "dict[Name, Line]" = field(default_factory=dict)
    """Who shares a serial line: `[lines.NAME]`."""
    script: "list[ScriptEntry]" = field(default_factory=list)
    """What is done to the cell, and when: `[[script]]`."""
    boards: "dict[Name, Board]" = field(default_factory=dict)
    """Boards with real pins, which `serve --real` drives: `[boards.NAME]`."""
    hardware: "Annotated[dict[str, Hardware], BeforeValidator(by_axis)]" = field(default_factory=dict)
    """Which pins of a board are behind a unit: `[hardware.UNIT]`, or `[hardware.UNIT.AXIS]`."""
    file: str = ""
    """The name of the file in error messages; no key of a file."""

    def __post_init__(self) -> None:
        if not self.units:
            raise ValueError("a cell needs at least one unit: [units.NAME] with model = 'gs-c200'")


def parse(text: str, file: str) -> Description:
    """The description in the TOML `text`. Raises Problem."""
    try:
        data = toml.loads(text)
    except toml.NoToml as error:
        raise Problem(file, "", str(error)) from None
    if "file" in data:
        raise Problem(file, "file", "there is no such key; remove it")
    return _checked(Description, {**data, "file": file}, file)


def single(
    model: str,
    *,
    straps: Mapping[str, int | str] | None = None,
    options: Mapping[str, int | float | str] | None = None,
    program: str | None = None,
) -> Description:
    """A cell of one unit, named like its model. Raises Problem."""
    unit = Unit(model=model, straps=dict(straps or {}), options=dict(options or {}), program=program)
    if any(type(value) is not str for value in (*unit.straps.values(), *unit.options.values())):
        _checked(Description, {"units": {model: unit.__dict__}}, "")  # a text may be anything that it likes
    return Description(units={model: unit})


def _checked(kind: type[Kind], data: Mapping[str, Any], file: str) -> Kind:
    from detent.cell.form import FormError, check

    try:
        return check(kind, data)
    except FormError as error:
        (key, message), *others = error.faults
        more = "".join(f"; {k}: {m}" if k else f"; {m}" for k, m in others[: MOST_PROBLEMS - 1])
        left = len(error.faults) - MOST_PROBLEMS
        raise Problem(file, key, message + more + (f"; and {left} more" if left > 0 else "")) from None
