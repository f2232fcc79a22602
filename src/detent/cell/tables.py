"""The tables of a cell file besides its units: wires, switches, motors, lines, script."""

from typing import Annotated, Literal

from pydantic import AliasChoices, BaseModel, Field, model_validator

from detent.cell.fields import STRICT, DurationField, Flag, KeyFault, LevelField, Names, Number, Steps
from detent.pins import HIGH, LOW

LEAST_LEAD = 1e-9


class _Table(BaseModel):
    model_config = STRICT


class Wire(_Table):
    """``[[wires]]``: an output to one input or several."""

    source: str = Field(validation_alias=AliasChoices("from"))
    """UNIT.PIN: an output."""
    to: Names
    """UNIT.PIN: inputs; also straps, which are read at power-on."""


class Switch(_Table):
    """``[switches.NAME]``: a contact that drives pins, set by the script or by an axis."""

    drives: Names
    """UNIT.PIN: the inputs, which nothing else may drive."""
    level: LevelField = HIGH
    """When the cell starts; on an axis the place decides."""
    axis: str | None = None
    """The unit whose axis moves the contact, UNIT.AXIS where it has several; or a motor, whose rotor moves it."""
    start: Steps | Number | None = Field(None, validation_alias=AliasChoices("from"))
    """Steps, on a motor with `lead` a distance: the first place of the range; left out: no end there."""
    end: Steps | Number | None = Field(None, validation_alias=AliasChoices("to"))
    """The last place of the range; left out: no end there."""
    at: Steps | None = None
    """A range of one step: the same as `from` and `to`."""
    inside: LevelField = LOW
    """The level within the range; outside it is the other one."""
    machine: Flag = False
    """It stands for a switch of the machine that is wired in `[hardware]`: without `--real`, and behind a `fake:`
    board. Where pins are driven the real one counts."""

    @model_validator(mode="after")
    def _placed(self) -> "Switch":
        if self.machine and self.axis is None:
            raise KeyFault("machine", "such a switch is moved by an axis: name it with axis = 'UNIT'")
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
    """A: while the controller ramps, by its pin RAMP, which is wired; then `slew` and `rest` go with it."""
    slew: float = 0.0
    """A: while it moves otherwise, by its pin MOV."""
    rest: float = 0.0
    """A: while it stands."""
    run: float = 0.0
    """A: while it moves; then `hold` and `after` go with it."""
    hold: float = 0.0
    """A: while it stands."""
    after: DurationField = 0
    """How long behind the last step it is `run` still."""

    @model_validator(mode="after")
    def _one_of_two(self) -> "Current":
        if (self.run > 0) == (self.ramp > 0):
            raise ValueError("give ramp, slew and rest (with MOV and RAMP wired), or run, hold and after")
        return self


class Motor(_Table):
    """``[motors.NAME]``: a motor with drive and load on the axis of a unit, or on step pulses that a wire brings."""

    motor: str = ""
    """One of `detent motor`, or a [TOML file of your own](motors.md#your-own-motor-and-mechanics) beside this one; left
    out, `data` is all of it."""
    unit: str | None = None
    """Whose pulses it gets; left out: steps come over its pins CLOCK and DIR."""
    axis: str = ""
    """Of a unit that has several."""
    supply: float
    """V: of the drive."""
    current: float | Current | None = None
    """A with both phases on, or a table `current`; left out: the motor's rating."""
    step: str = "half"
    """full, wave, half, half-compensated, or 1/2 to 1/64."""
    decay: Literal["fast", "slow", "mixed", "auto", "voltage"] = "fast"
    """Of the current: `auto` goes with `threshold`; `voltage` is pulse width without current feedback."""
    drive: str = ""
    """By name, in place of `decay`: [which there are](motors.md#drives)."""
    threshold: float = 0.0
    """Full steps/s from which on decay is fast, with `auto`."""
    drop: float = 0.0
    """V: lost in the switches."""
    resistance: float = 0.0
    """Ohm: of switches and wires."""
    fitted: bool = False
    """Inductance and friction are fitted to the maker's torque curve."""
    wiring: Literal["", "series", "parallel", "unipolar"] = ""
    """Of a motor that is sold for several."""
    damping: Number | None = None
    """A ratio: of the bare rotor, about the speed of the pulses; left out: 0.12 for a chopper, 0.03 for `voltage`
    ([why](motors.md#how-far-to-believe-it))."""
    data: dict[str, Steps | Number | str] = {}
    """A motor of your own, or what is different in the named one, in SI units: `resistance`, `inductance`, `current`,
    `holding_torque` (these four are needed), `inertia`, `steps` and what else `detent motor` knows."""
    load: dict[Literal["inertia", "friction", "viscous", "torque"], Annotated[float, Field(ge=-1e6, le=1e6)]] = {}
    """kg m2, Nm, Nm s/rad, Nm."""
    mechanics: dict[str, Number] = {}
    """Added to `load`: screw (m a turn), belt or rack (radius, m), gear, mass (kg), slope (degrees), force, drag (N),
    efficiency, driven_inertia and what else `detent motor` takes."""
    load_by: dict[Literal["s", "turns", "m"], Annotated[list[tuple[Number, Number]], Field(max_length=100_000)]] = {}
    """A torque that changes: points of seconds, turns or metres, from where the rotor stands at first, and Nm."""
    lead: Number | None = None
    """Distance a step: then switches with `axis` = this motor are placed in distances. Not 0."""
    reverse: bool = False
    """Plus turns the motor the other way."""
    window: float = Field(0.5, gt=0, le=4)
    """Steps: how far short of a step the step detector (pin DONE) takes it for made."""

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
    """Who is on the line, in order; the last has TXPD tied unless straps say otherwise."""
    endpoint: str | None = None
    """Where `serve` puts it: `pty`, `pty:LINK`, `tcp:HOST:PORT`, `rfc2217:HOST:PORT`, `serial:DEVICE`; left out: a
    pseudo-terminal."""
    host: str | None = None
    """The adapter that is the host of this line: [SIN-8, SIN-10](../controllers/dcb274.md#serial-modes)."""
    kind: str | None = None
    """`daisy-chain`: host to first unit, each unit to the next, the last one to the host."""

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
    """Since the start of the cell."""
    set: dict[str, LevelField] = {}
    """Levels of switches; or of UNIT.PIN, an input that nothing else drives (1 until then)."""
    send: Names = []
    """Command lines for `to`; address, checksum and CR are added."""
    to: str | None = None
    """The unit that `send` is for."""
    power: dict[str, bool] = {}
    """Switch the supply of a unit; straps are read and volatile memory is empty at power-on."""

    @model_validator(mode="after")
    def _something(self) -> "ScriptEntry":
        if not (self.set or self.send or self.power):
            raise ValueError("nothing to do: give set, send or power")
        return self
