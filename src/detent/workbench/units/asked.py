"""What a unit can be asked, and what it said: questions of its manual that change nothing, in one look.

What a unit does not tell is None, and so shown as unknown. A look is a generator of steps, as the operations of the
drivers are: tests play the unit with a list of answers.
"""

from functools import singledispatch
from typing import Final, NamedTuple

from detent.hosts.dcb274 import Dcb274
from detent.hosts.dcb274.answers import MOVING
from detent.hosts.errors import Busy, MotionFailed, Refused
from detent.hosts.exchange import Driver, Steps
from detent.hosts.genstepper import GenStepper
from detent.hosts.gsc200 import GsC200
from detent.hosts.supersigma import Supersigma

STORES: Final = "program mode: what is sent is stored"


class Fact(NamedTuple):
    """One thing that a unit told, as it is shown; None: it does not tell, or not now. `source`: how it was asked."""

    name: str
    value: str | None
    source: str
    lamp: bool = False  # an input or output: 0 or 1


class Look(NamedTuple):
    """What a unit told at one time."""

    state: str  # in a word or two
    moving: bool | None
    position: int | None
    rate: float | None = None  # steps/s
    facts: tuple[Fact, ...] = ()


@singledispatch
def look(driver: Driver) -> Steps[Look]:
    """Ask the unit of `driver` what it can be asked at any time. Raises DriverError where it does not answer."""
    raise NotImplementedError(f"nobody knows what {driver.title} can be asked")
    yield


# -- GS-C200: F always, the rest while it is ready ----------------------------------------------------------------

_PINS: Final = [f"U{kind}{number}" for kind in "IO" for number in (1, 2, 3)]


@look.register
def _(driver: GsC200) -> Steps[Look]:
    """F; while the module is ready V1 and V2. While it is busy it answers nothing else."""
    ended = ""
    try:
        busy = yield from driver.moving()
    except MotionFailed as error:  # an error of a motion or a program is told once
        busy, ended = False, error.what
    position: int | None = None
    pins: list[str | None] = [None] * len(_PINS)
    state = STORES if driver.programming else "busy" if busy else ended or "ready"
    if not busy:
        try:
            position = yield from driver.position()
            levels = yield from driver.pins()
            pins = [str(int(level)) for level in (*levels.inputs, *levels.outputs)]
        except (Busy, Refused) as error:
            state = error.what
    facts = [Fact(name, value, "V2", lamp=True) for name, value in zip(_PINS, pins, strict=True)]
    facts += [Fact(name, None, "it cannot be asked") for name in ("start-stop speed S", "slew speed T", "ramp R")]
    return Look(state, busy, position, None, tuple(facts))


# -- DCB-274: lines at rest and in motion, none while a program runs ----------------------------------------------


@look.register
def _(driver: Dcb274) -> Steps[Look]:
    """^, Z, ] 0 and A 129; in single mode at rest X, too. While a program runs it takes no line."""
    names = ("limit A", "limit B", "home")
    if driver.programming:  # it would store a question
        facts = tuple(Fact(name, None, "it is in program mode: P ends that", lamp=True) for name in names)
        return Look(STORES, None, None, None, facts)
    try:
        status = yield from driver.moving_status()
    except Busy:
        facts = tuple(Fact(name, None, "no line is taken while a program runs", lamp=True) for name in names)
        return Look("runs a program", None, None, None, facts)
    position = yield from driver.position()
    inputs = yield from driver.inputs()
    lamps = (inputs.limit_a, inputs.limit_b, inputs.home, inputs.p1, inputs.p2, inputs.p3, inputs.p4, inputs.p5)
    found = [
        Fact(name, str(int(level)), "] 0: 1 is active", lamp=True)
        for name, level in zip((*names, "P1", "P2", "P3", "P4", "P5"), lamps, strict=True)
    ]
    if driver.mode == "single" and status == 0:
        told = yield from driver.examine()
        values = {
            "initial I": f"{told.initial} steps/s",
            "slew V": f"{told.slew} steps/s",
            "divide D": str(told.divide),
            "ramp K": f"{told.up}/{told.down}",
            "resolution H": told.resolution,
            "name": told.name,
        }
    else:
        values = {}
    why = "X tells it at rest" if driver.mode == "single" else "it tells its settings in single mode only"
    settings = ("initial I", "slew V", "divide D", "ramp K", "resolution H", "name")
    found += [Fact(name, values.get(name), "X" if name in values else why) for name in settings]
    return Look(MOVING.get(status, f"^ tells {status}"), bool(status & 3), position, None, tuple(found))


# -- GenStepper: everything at any time ---------------------------------------------------------------------------


@look.register
def _(driver: GenStepper) -> Steps[Look]:
    """0? for this motor, and memory 5 for its limits."""
    told = yield from driver.reports()
    limits = yield from driver.limits()
    action = yield from driver.action()
    facts = (
        Fact(f"L{driver.motor}-", str(int(bool(limits.low))), "memory 5: 1 is met", lamp=True),
        Fact(f"L{driver.motor}+", str(int(bool(limits.high))), "memory 5: 1 is met", lamp=True),
        Fact("target", str(told.target), "-4?"),
        Fact("run rate R", f"{told.run_rate} microsteps/s", "-10?"),
        Fact("stop rate K", f"{told.stop_rate} microsteps/s", "-11?"),
        Fact("slope P", f"{told.slope} microsteps/s\N{SUPERSCRIPT TWO}", "-3?"),
        Fact("step mode O", str(told.step_mode), "-9?"),
        Fact("windings at rest W", None, "it cannot be asked"),
    )
    state = action.name.lower().replace("_", " ")
    return Look(state, state != "idle", told.position, float(told.speed), facts)


# -- SUPERSIGMA: status -------------------------------------------------------------------------------------------


@look.register
def _(driver: Supersigma) -> Steps[Look]:
    """Status. A drive counts the steps of one movement; the position is counted here, from where connecting began."""
    position = yield from driver.position()
    report = yield from driver.status()
    facts = (
        Fact("steps", str(report.steps), "status: of the last movement, or of the one under way"),
        *(
            Fact(name, str(int(level)), "status", lamp=True)
            for name, level in (
                ("end of rail", report.end_of_rail),
                ("force", report.excessive_force),
                ("originated", report.originated),
                ("refused", report.refused),
            )
        ),
        Fact("speed", None, "it cannot be asked"),
        Fact("position", str(position), "counted here, from 0 where the workbench connected or set it"),
    )
    return Look("moving" if report.moving else "at rest", report.moving, position, None, facts)
