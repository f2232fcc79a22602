"""The tables of a cell file besides its units: wires, switches, motors, lines, script."""

from typing import Annotated, Literal

from pydantic import AliasChoices, BaseModel, Field, model_validator

from detent.cell.fields import STRICT, DurationField, LevelField, Names, Number, Steps
from detent.pins import HIGH, LOW

LEAST_LEAD = 1e-9


class _Table(BaseModel):
    model_config = STRICT


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
