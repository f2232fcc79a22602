"""What hangs on which pin of a board, as a cell file says it; checked against the board before anything moves.

Pins are written as users of 3D printers write them: `!` active low, `^` pull-up, `~` pull-down before the name.
"""

from dataclasses import dataclass, field
from typing import Literal, NamedTuple, Self, TypeAlias

from detent.outputs.steps import Error
from detent.ticks import MS, SECOND, US, Ns

SHORTEST_BATCH: Ns = 1 * MS
LONGEST_BATCH: Ns = 4 * MS


class SetupProblem(ValueError):
    """Something on a board cannot be as it is asked: `item` (the name of a stepper, output ...), `key`, what and why.

    `key` is the field of the setup at fault, such as `step` or `watchdog`; the owner knows how its file calls it.
    """

    def __init__(self, item: str, key: str, text: str) -> None:
        self.item, self.key, self.text = item, key, text
        super().__init__(f"{item}.{key}: {text}" if key else f"{item}: {text}")


class Pin(NamedTuple):
    """A pin of a board by its name there."""

    name: str
    active_low: bool = False
    pull: Literal[-1, 0, 1] = 0  # -1 down, 1 up

    @classmethod
    def parse(cls, text: str) -> Self:
        """Of text like `!^gpio7`. ValueError with a remedy."""
        rest = text.strip()
        active_low, pull = False, 0
        while rest[:1] in ("!", "^", "~") and rest:
            if rest[0] == "!" and not active_low:
                active_low = True
            elif rest[0] in "^~" and not pull:
                pull = 1 if rest[0] == "^" else -1
            else:
                raise ValueError(
                    f"{text!r} says {rest[0]} twice, or both pulls; write it like gpio7, !gpio7 or !^gpio7"
                )
            rest = rest[1:].lstrip()
        if not rest or any(c.isspace() or c in "!^~" for c in rest):
            raise ValueError(f"{text!r} is no pin; write it like gpio7, !gpio7 or !^gpio7")
        return cls(rest, active_low, pull)  # type: ignore[arg-type]  # one of -1, 0, 1

    def __str__(self) -> str:
        return ("!" if self.active_low else "") + {1: "^", -1: "~", 0: ""}[self.pull] + self.name


@dataclass(frozen=True, slots=True)
class StepperSetup:
    """An axis: its step clock and its direction, or a clock for each direction.

    A pulse is `pulse` long at least, active as `step` says. `dir` is high in direction +1, low in -1, or the other
    way round if it is active low. With `minus` the pulses of direction -1 come there, those of +1 on `step`, and
    `dir` is a spare pin: the firmware cannot do without one. `stops` are the inputs that may stop it (None: every input
    of the board): each takes an object of the firmware. Axes of one `unit` are late together.
    """

    name: str
    step: Pin
    dir: Pin
    pulse: Ns = 5 * US
    minus: Pin | None = None
    stops: tuple[str, ...] | None = None
    unit: str = ""


@dataclass(frozen=True, slots=True)
class OutputSetup:
    """A digital output. Levels are logical: an active low pin is low where it is told True.

    `initial` is how it comes up, `off` what it falls to at a shutdown, and, with a `watchdog`, when nobody has
    refreshed it for so long (the firmware then shuts down). It is late together with the axes of its `unit`.
    `supply`: it is active while the unit has its supply, which no stop takes back.
    """

    name: str
    pin: Pin
    initial: bool = False
    off: bool = False
    watchdog: Ns | None = None
    unit: str = ""
    supply: bool = False


@dataclass(frozen=True, slots=True)
class InputSetup:
    """An input. Where it stops an axis it is sampled every `sample`, and believed after `samples` alike in a row."""

    name: str
    pin: Pin
    sample: Ns = 50 * US
    samples: int = 2


DriverKind = Literal["tmc2208", "tmc2209", "tmc2130", "tmc5160"]


@dataclass(frozen=True, slots=True)
class DriverSetup:
    """A stepper driver chip whose registers are set. `sense` is its resistor in ohm.

    `amperes` is the current of a phase (its peak / sqrt 2: RMS at rest between the steps) that stands for full power
    where a controller commands fractions of it; of one that commands amperes it is the most that the chip is told.
    UART: `uart` (one wire; or `uart` receives and `transmit` sends), `address` 0..3 of a TMC2209.
    SPI: `select`, and either a hardware `bus` by its name in the dictionary, or the pins `clock`, `mosi`, `miso`.
    `quiet` (stealthChop) while slow decay is asked for.
    """

    name: str
    kind: DriverKind
    sense: float = 0.11
    amperes: float | None = None
    uart: Pin | None = None
    transmit: Pin | None = None
    address: int = 0
    select: Pin | None = None
    bus: str | None = None
    clock: Pin | None = None
    mosi: Pin | None = None
    miso: Pin | None = None
    quiet: bool = False
    interpolate: bool = True


@dataclass(frozen=True, slots=True)
class BoardSetup:
    """Everything on one board, and how it is driven.

    `lead`: what leaves the pins is so long behind the cell. `error`: of a pulse, at most. A pulse that would be due in
    less than `margin` from now is late: the rest of its unit slips (see `Lag`).
    """

    name: str
    lead: Ns = 30 * MS
    error: Error = US
    margin: Ns = 4 * MS
    steppers: tuple[StepperSetup, ...] = ()
    outputs: tuple[OutputSetup, ...] = ()
    inputs: tuple[InputSetup, ...] = ()
    drivers: tuple[DriverSetup, ...] = field(default=())

    @property
    def batch(self) -> Ns:
        """So long pulses are gathered, while there is time: longer runs, and less work; an eighth of the lead."""
        return min(max(self.lead // 8, SHORTEST_BATCH), LONGEST_BATCH)

    def items(self) -> "list[Item]":
        """Everything on it that has a name and pins."""
        return [*self.steppers, *self.outputs, *self.inputs, *self.drivers]

    def check(self) -> None:
        """Raise SetupProblem for what is wrong on any board: names and pins used twice, values out of range."""
        names: set[str] = set()
        used: dict[str, str] = {}
        if self.lead < 3 * self.margin or self.margin < 1 * MS:
            raise SetupProblem(self.name, "lead", f"a lead of {self.lead / MS:g} ms is too short for a margin of "
                               f"{self.margin / MS:g} ms: take {3 * self.margin / MS:g} ms or more")  # fmt: skip
        if self.lead > SECOND // 2:
            raise SetupProblem(self.name, "lead", f"a lead of {self.lead / MS:g} ms: take 500 ms at most")
        for item in self.items():
            if item.name in names:
                raise SetupProblem(item.name, "", f"there are two things of that name on the board {self.name}")
            names.add(item.name)
            for key, pin in _pins(item):
                if pin.name in used and not _shared(item, key, used[pin.name]):
                    raise SetupProblem(item.name, key, f"the pin {pin.name} is taken by {used[pin.name]}; "
                                       "use another for one of them")  # fmt: skip
                used.setdefault(pin.name, f"{item.name}.{key}")
        for out in self.outputs:
            if out.watchdog is not None and out.watchdog < max(200 * MS, 4 * self.lead):
                raise SetupProblem(out.name, "watchdog", f"{out.watchdog / MS:g} ms is less than a busy computer "
                                   f"needs; take {max(200 * MS, 4 * self.lead) / MS:g} ms or more")  # fmt: skip
        inputs = {entry.name for entry in self.inputs}
        for stepper in self.steppers:
            for name in stepper.stops or ():
                if name not in inputs:
                    raise SetupProblem(stepper.name, "stops", f"{name} is no input of the board {self.name}: an input "
                                       "stops only what is on its own board")  # fmt: skip
        for entry in self.inputs:
            if not 1 <= entry.samples <= 255 or not 10 * US <= entry.sample <= 10 * MS:
                raise SetupProblem(entry.name, "sample", "an input is sampled 1 to 255 times, every 10 us to 10 ms")


Item: TypeAlias = StepperSetup | OutputSetup | InputSetup | DriverSetup


def _pins(item: Item) -> list[tuple[str, Pin]]:
    keys = ("step", "dir", "minus", "pin", "uart", "transmit", "select", "clock", "mosi", "miso")
    return [(key, pin) for key in keys if isinstance(pin := getattr(item, key, None), Pin)]


def _shared(item: object, key: str, before: str) -> bool:
    """Whether a pin may be used again: the wires of a bus, and the UART of chips with addresses."""
    taken = before.rpartition(".")[2]
    return isinstance(item, DriverSetup) and (
        (key in ("clock", "mosi", "miso") and taken == key) or (key in ("uart", "transmit") and taken == key)
    )
