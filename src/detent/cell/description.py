"""A cell as its TOML file describes it, checked for form; `build` checks it for sense.

Every fault becomes a `Problem`: one line with the file, the key and what to do. Reading files is the caller's
business; this module is given text.
"""

import re
import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from reprlib import Repr
from typing import Annotated, Any, Literal

from pydantic import (
    AliasChoices,
    BaseModel,
    BeforeValidator,
    Field,
    ValidationError,
    model_validator,
)

from detent.cell.fields import STRICT, DurationField, LevelField, Name, Names, Number, Steps
from detent.cell.hardware import Board, Hardware, by_axis
from detent.pins import HIGH, LOW

MOST_PROBLEMS = 5
LEAST_LEAD = 1e-9

_KINDS = ("[key]", "constrained-int", "constrained-float", "int", "float", "str")  # no keys, but what was tried
_BARE = re.compile(r"[A-Za-z0-9_.$ -]{1,64}")

_shown = Repr()
_shown.maxstring = _shown.maxother = _shown.maxlong = 60


class Problem(ValueError):
    """Something wrong with a cell, a program or a choice. `str` is one line: file, key, what, remedy."""

    def __init__(self, file: str, key: str, message: str) -> None:
        super().__init__(": ".join(part for part in (file, key, message) if part))
        self.file, self.key, self.message = file, key, message


class _Table(BaseModel):
    model_config = STRICT


class Unit(_Table):
    """``[units.NAME]``: a controller, or another part with pins."""

    model: str
    program: str | None = None  # file, loaded into program memory and started when the cell starts
    eeprom: str | None = None  # file, in non-volatile memory unless an image is kept for the unit
    straps: dict[str, Steps | str] = {}
    options: dict[str, Steps | Number | str] = {}
    powered: bool = True  # when the cell starts
    shaft: Steps = 0  # where the axis stands when the cell starts, in steps
    supply: Number | None = None  # V, checked against the model's limits
    loads: dict[str, Number] = {}  # A drawn from supply outputs by pin, checked likewise


class Wire(_Table):
    """``[[wires]]``: an output to one input or several."""

    source: str = Field(validation_alias=AliasChoices("from"))
    to: Names


class Switch(_Table):
    """``[switches.NAME]``: a contact that drives pins, set by the script or by an axis."""

    drives: Names
    level: LevelField = HIGH  # when the cell starts; an axis decides for itself
    axis: str | None = None  # the unit (UNIT.AXIS where it has several), or the motor, whose axis moves the contact
    start: Steps | Number | None = Field(None, validation_alias=AliasChoices("from"))  # steps; on a motor, its distance
    end: Steps | Number | None = Field(None, validation_alias=AliasChoices("to"))
    at: Steps | None = None  # the same as from and to
    inside: LevelField = LOW  # the level between from and to

    @model_validator(mode="after")
    def _placed(self) -> "Switch":
        places = (self.start, self.end, self.at)
        if self.axis is None and any(place is not None for place in places):
            raise ValueError("from, to and at are places on an axis: name it with axis = 'UNIT'")
        if self.axis is not None and all(place is None for place in places):
            raise ValueError("a switch on an axis needs its place: at, or from and to, in steps")
        if self.at is not None and (self.start is not None or self.end is not None):
            raise ValueError("give either at, or from and to")
        if self.start is not None and self.end is not None and self.start > self.end:
            raise ValueError("from must not be greater than to")
        return self

    @property
    def range(self) -> tuple[int | float | None, int | float | None]:
        """First and last place at which the level is `inside`."""
        return (self.at, self.at) if self.at is not None else (self.start, self.end)


class Current(_Table):
    """The phase current, A: ramp, slew, rest by MOV and RAMP, or run, and hold `after` the last step."""

    ramp: float = 0.0
    slew: float = 0.0
    rest: float = 0.0
    run: float = 0.0
    hold: float = 0.0
    after: DurationField = 0

    @model_validator(mode="after")
    def _one_of_two(self) -> "Current":
        if (self.run > 0) == (self.ramp > 0):
            raise ValueError("give ramp, slew and rest (with MOV and RAMP wired), or run, hold and after")
        return self


class Motor(_Table):
    """``[motors.NAME]``: a motor with drive and load on the axis of a unit, or on step pulses that a wire brings."""

    motor: str = ""  # by name; without one the `data` are all of it
    unit: str | None = None
    axis: str = ""  # where the unit has several
    supply: float  # V
    current: float | Current | None = None  # A in each phase with both on; the motor's rating
    step: str = "half"
    decay: Literal["fast", "slow", "mixed", "auto", "voltage"] = "fast"
    drive: str = ""  # by name (tmc2209, a4988, ...): its decay, its switches, whether it interpolates
    threshold: float = 0.0  # full steps/s from which on decay is fast (auto)
    drop: float = 0.0  # V in the switches
    resistance: float = 0.0  # ohm of switches and wires
    fitted: bool = False  # to the maker's torque curve
    wiring: Literal["", "series", "parallel", "unipolar"] = ""  # of a motor that is sold for several; as it is named
    damping: Number | None = None  # ratio of the bare rotor; None: the motor's own, or what is usual with the drive
    data: dict[str, Steps | Number | str] = {}  # an own motor, or what is different in the named one: SI units
    load: dict[Literal["inertia", "friction", "viscous", "torque"], Annotated[float, Field(ge=-1e6, le=1e6)]] = {}
    mechanics: dict[str, Number] = {}  # screw, belt, rack, gear, mass, ...: what `detent.motors.mechanics` takes
    load_by: dict[Literal["s", "turns", "m"], Annotated[list[tuple[Number, Number]], Field(max_length=100_000)]] = {}
    lead: Number | None = None  # distance a step: then places of switches are distances
    reverse: bool = False  # plus turns the motor the other way
    window: float = Field(0.5, gt=0, le=4)  # steps that the step detector takes for made

    @model_validator(mode="after")
    def _known(self) -> "Motor":
        if not (self.motor or self.data):
            raise ValueError("name the motor with motor = 'NAME' (detent motor lists them), or give its data")
        if self.lead is not None and abs(self.lead) < LEAST_LEAD:
            raise ValueError("lead is the distance that a step moves, and not 0: leave it out to count in steps")
        return self


class Line(_Table):
    """``[lines.NAME]``: the units on one serial line, and where a host finds it."""

    units: Names
    endpoint: str | None = None  # 'pty', 'pty:LINK', 'tcp:HOST:PORT' or 'serial:DEVICE'
    host: str | None = None  # the unit that is the host of this line: an adapter, which has a line of its own
    kind: str | None = None  # 'daisy-chain': the host to the first unit, each unit to the next, the last to the host

    @model_validator(mode="after")
    def _sane(self) -> "Line":
        if self.kind not in (None, "daisy-chain"):
            raise ValueError("kind is 'daisy-chain', or left out")
        if self.host is not None and self.kind is not None:
            raise ValueError("a daisy chain has no host among the units: give either host or kind")
        if self.host is not None and self.endpoint is not None:
            raise ValueError("the host of this line is a unit: give the endpoint to the line of that unit")
        return self


class ScriptEntry(_Table):
    """``[[script]]``: what is done to the cell at a time."""

    at: DurationField
    set: dict[str, LevelField] = {}  # switches, or inputs that nothing else drives
    send: Names = []  # command lines, to the unit `to`
    to: str | None = None
    power: dict[str, bool] = {}

    @model_validator(mode="after")
    def _something(self) -> "ScriptEntry":
        if not (self.set or self.send or self.power):
            raise ValueError("nothing to do: give set, send or power")
        return self


class Description(_Table):
    """A whole cell file. `file` is its name in error messages."""

    title: str = ""
    units: dict[Name, Unit]
    wires: list[Wire] = []
    switches: dict[Name, Switch] = {}
    motors: dict[Name, Motor] = {}
    lines: dict[Name, Line] = {}
    script: list[ScriptEntry] = []
    boards: dict[Name, Board] = {}
    hardware: Annotated[dict[str, Hardware], BeforeValidator(by_axis)] = {}
    file: str = ""

    @model_validator(mode="after")
    def _units(self) -> "Description":
        if not self.units:
            raise ValueError("a cell needs at least one unit: [units.NAME] with model = 'gs-c200'")
        return self


def parse(text: str, file: str) -> Description:
    """The description in the TOML `text`. Raises Problem."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise Problem(file, "", f"this is no TOML: {error}") from None
    except RecursionError:
        raise Problem(file, "", "its tables and lists are nested too deeply: no key of a cell is") from None
    except ValueError:  # an integer of more digits than Python reads
        raise Problem(file, "", "it has a number of thousands of digits: no number of a cell is so long") from None
    if "file" in data:
        raise Problem(file, "file", "there is no such key; remove it")
    return _validate({**data, "file": file}, file)


def single(
    model: str,
    *,
    straps: Mapping[str, int | str] | None = None,
    options: Mapping[str, int | float | str] | None = None,
    program: str | None = None,
) -> Description:
    """A cell of one unit, named like its model. Raises Problem."""
    unit = {"model": model, "straps": dict(straps or {}), "options": dict(options or {}), "program": program}
    try:  # the unit alone: a whole cell takes longer to make ready for than all the rest of a start
        return Description.model_construct(units={model: Unit.model_validate(unit)})
    except ValidationError:
        return _validate({"units": {model: unit}}, "")


def _validate(data: dict[str, Any], file: str) -> Description:
    try:
        return Description.model_validate(data)
    except ValidationError as error:
        faults = list(dict([_fault(item) for item in error.errors()]).items())  # of a key, the last is enough
        key, message = faults[0]
        more = "".join(f"; {k}: {m}" if k else f"; {m}" for k, m in faults[1:MOST_PROBLEMS])
        left = len(faults) - MOST_PROBLEMS
        raise Problem(file, key, message + more + (f"; and {left} more" if left > 0 else "")) from None


def _fault(item: Any) -> tuple[str, str]:
    """The key and the message of one of pydantic's errors."""
    path: list[str] = []
    for part in item["loc"]:
        if part in _KINDS:
            continue
        if isinstance(part, int):
            path[-1] += f"[{part + 1}]"
        else:
            path.append(part if _BARE.fullmatch(part) else _shown.repr(part))
    key = ".".join(path)
    if item["type"] == "extra_forbidden":
        known = _known(item["loc"])
        near = get_close_matches(str(item["loc"][-1]), known, 1, 0.5)
        hint = f"did you mean {near[0]}? " if near else ""
        return key, f"there is no such key; {hint}there are: {', '.join(known)}"
    if item["type"] == "missing":
        return key, "this key is missing"
    message = item["msg"].removeprefix("Value error, ").replace("Input should", "it should")
    return key, f"{message} (it is {_shown.repr(item['input'])})" if not isinstance(item["input"], dict) else message


def _known(location: tuple[int | str, ...]) -> list[str]:
    """The keys that the table of a wrong key takes."""
    tables: dict[str, type[BaseModel]] = {
        "units": Unit, "wires": Wire, "switches": Switch, "motors": Motor, "lines": Line, "script": ScriptEntry,
        "boards": Board, "hardware": Hardware,
    }  # fmt: skip
    table = tables.get(str(location[0]), Description) if len(location) > 1 else Description
    names = []
    for name, field in table.model_fields.items():
        alias = field.validation_alias
        names.append(str(alias.choices[0]) if isinstance(alias, AliasChoices) else name)
    return [name for name in names if name != "file"]
