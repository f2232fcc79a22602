"""BS0610 and BS0710 with GenStepper, as their manual has them."""

from collections.abc import Mapping, Sequence
from random import Random
from typing import Any

from tests.controllers.laws.adapter import Limit, Redefinition, Stop
from tests.controllers.laws.bench import Action, Bench, Contact, Power, Put, Raw, Say, Wait

from detent.controllers.genstepper.firmware import GenStepper
from detent.pins import HIGH, LOW, Level
from detent.ticks import MS, SECOND, US, Ns

TICK = 16 * US  # "62 500 microsteps/second": one look at the speed (page 20)
KEYS = ("X+", "X-", "Y+", "Y-")
LIMITS = ("LY-", "LY+", "LX-", "LX+")  # bits 0 to 3 of T (page 34)
STEPS = (0, 1, -1, 7, 300, -300, 2000, -2000, 9000, -40_000)
RATES = (1, 50, 80, 81, 400, 800, 3000, 16_000, 62_500)
SLOPES = (400, 1000, 8000, 40_000, 62_500)
REPORTS = ("idle", "ramping up", "at speed", "slowing", "slewing", "quick stop", "reversing", "stopping for a new go")
"""The step actions of page 42."""
QUESTIONS = ("-1?", "0?", "L", "X", "Y", "B", "125?", "00", " ", "+", "800R", "1H", "3O", "-", "0A")


def ramp(bench: Bench, axis: str) -> tuple[int, int]:
    """The stop OK rate and the slope that an axis has now."""
    registers = bench.device.registers(bench.now)
    return int(registers[f"{axis} K"]), int(registers[f"{axis} P"])


def ramp_time(bench: Bench) -> Ns:
    """Z: "ramped to a complete stop according to its current ramp rate"; stopped is K or below (page 36)."""
    longest = 0.0
    for axis, travel in bench.travels.items():
        keep, slope = ramp(bench, axis)
        longest = max(longest, (travel.rate(bench.now) - keep) / slope)
    return int(longest * SECOND) + 4 * TICK


def ramp_steps(rate: float, keep: int, slope: int) -> int:
    """Microsteps from a rate down to the stop OK rate, the one on its way and a tick besides."""
    return 2 if rate <= keep else int((rate * rate - keep * keep) / (2 * slope)) + int(rate * TICK / SECOND) + 2


def at_once(bench: Bench) -> Ns:
    """No ramp."""
    return 0


def ahead(bench: Bench, axis: str) -> str:
    """The limit towards which an axis moves."""
    return f"L{axis}{'+' if bench.travels[axis].direction > 0 else '-'}"


class Board:
    """A board; `hard`: limits stop at once, by order (page 12)."""

    axes = ("X", "Y")
    phases = REPORTS
    modulus = 1 << 40  # it saturates, far away

    def __init__(self, name: str, *, hard: bool) -> None:
        self.name, self._hard = name, hard

    def options(self, draw: Random) -> Mapping[str, Any]:
        return draw.choice(({}, {}, {"stop_rate": 1000, "run_rate": 4000}, {"ramp": 1000}))

    def make(self, options: Mapping[str, Any]) -> GenStepper:
        return GenStepper(self.name, line_timing=False, hard_stop=self._hard, **options)

    def ready(self) -> Sequence[Action]:
        return (Wait(300 * MS),)  # deaf for a quarter of a second (page 22)

    def contacts(self, draw: Random) -> tuple[Contact, ...]:
        found = []
        for pin in draw.sample(LIMITS, draw.choice((0, 0, 1, 2))):
            at, width = draw.randint(5, 2500), draw.choice((0, 3, 50, 10**9))
            low = at if pin.endswith("+") else -at - width
            found.append(Contact(pin, pin[1], low, low + width))
        return tuple(found)

    def actions(self, draw: Random) -> Sequence[Action]:
        who, letter = draw.choice(("X", "Y", "B", "", "")), draw.choice
        steps = draw.choice(STEPS) if draw.random() < 0.7 else draw.randint(-600, 600)
        match draw.randrange(16):
            case 0 | 1 | 2 | 3:
                return [Say(f"{who}{steps}{letter('GGS')}")]
            case 4 | 5 | 6:
                return [Say(f"{who}{letter('+-')}S")]
            case 7:
                return [Say(who + letter(("Z", "0M", "1M", "100=", "I", "+X-Y+S")))]
            case 8:
                return [Say(f"{who}{draw.choice(RATES)}{letter('RRK')}")]
            case 9:
                return [Say(f"{who}{draw.choice(SLOPES)}P")]
            case 10 | 11:
                return [Put(draw.choice(KEYS), draw.choice((LOW, LOW, HIGH)))]
            case 12 | 13:
                pin, time = draw.choice((*KEYS, *LIMITS, "NXT")), draw.choice((1, 16 * US, 5 * MS, 80 * MS))
                return [Put(pin, LOW), Wait(time), Put(pin, HIGH)]
            case 14:
                return self.meanwhile(draw)
        return self._rare(draw)

    def _rare(self, draw: Random) -> Sequence[Action]:
        match draw.randrange(7):
            case 0:
                return [Power(False), Wait(1 * MS), Power(True), *self.ready()]
            case 1:
                return [Say("1E"), Wait(1 * MS), Put("X+", LOW), Wait(1 * MS), Put("X+", HIGH), Say("0E")]
            case 2:
                return [Say("4!"), *self.ready()]
            case 5:  # limits blocked, or active when high (page 34)
                return [Say(draw.choice(("15T", "0T", "240T", "0T")))]
        return [Raw(draw.randbytes(draw.randrange(5)), draw.randrange(-1, 3))]

    def meanwhile(self, draw: Random) -> Sequence[Action]:
        return [Say(draw.choice(QUESTIONS))]

    def phase(self, bench: Bench, axis: str) -> str:
        told = bench.device._motors[axis].step_action(bench.now)  # type: ignore[attr-defined]  # what -8? reports
        return (
            REPORTS[told] if told < 8 else "quick stop" if bench.travels[axis].moving else "idle"
        )  # 8: a limit is seen

    def let_go(self, bench: Bench) -> Sequence[Action]:
        return [Put(key, HIGH) for key in KEYS if bench.level(key) == LOW]

    def stops(self) -> Sequence[Stop]:
        return (
            Stop("Z", "36", lambda bench: [Say("BZ")], ramp_time),
            Stop("=", "38", lambda bench: [Say("B77=")], ramp_time),
            Stop("!", "37", lambda bench: [Say("4!")], at_once),
            Stop("E", "20", lambda bench: [Say("1E"), Say("0E")], at_once),
            Stop("RST", "60", lambda bench: [Put("RST", LOW), Put("RST", HIGH)], at_once),
            Stop("VC", "7", lambda bench: [Put("VC", LOW), Put("VC", HIGH)], at_once),
            Stop("power", "7", lambda bench: [Power(False)], at_once),
            Stop("limit", "12, 20", lambda bench: [Put(ahead(bench, axis), LOW) for axis in bench.moving],
                 at_once if self._hard else ramp_time, self._limit_opens, lambda bench: bench.moving),
        )  # fmt: skip

    def _limit_opens(self, bench: Bench) -> bool:
        if mask(bench) != (False, LOW):
            return False
        return all(bench.level(ahead(bench, axis)) == HIGH for axis in bench.moving) and bool(bench.moving)

    def meets(self, phase: str, stop: Stop) -> bool:
        return not (phase == "idle" and stop.name == "limit")

    def redefinition(self, draw: Random) -> Redefinition:
        value = draw.choice((0, 1, 5, 100, -77, 4096, -100_001))
        who, axes = draw.choice((("X", ("X",)), ("Y", ("Y",)), ("B", ("X", "Y"))))
        return Redefinition("=", "38", [Say(f"{who}{value}=")], [Say(f"{who}{value}Z")], value, axes, hears)

    def redefines(self, bench: Bench) -> bool:
        last = bench.actions[-1]
        if isinstance(last, Say):
            return "=" in last.text or "!" in last.text
        return isinstance(last, Power) or (isinstance(last, Raw) and bool(set(last.data) & set(b"=!")))

    def onward(self, draw: Random) -> Sequence[Action]:
        match draw.randrange(8):
            case 0 | 1 | 2:
                return [Say(f"{draw.choice('XYB')}{draw.choice((300, -900, 5, 4000))}S")]
            case 3 | 4:
                return [Say(draw.choice(("B+S", "X-S", "Y+S", "BZ", "B3O", "B1O", "B1W", "B8000R", "900R")))]
            case 5:
                return [Put(draw.choice(KEYS), draw.choice((LOW, HIGH, HIGH)))]
            case 6:
                pin = draw.choice(LIMITS)
                return [Put(pin, LOW), Wait(5 * MS), Put(pin, HIGH)]
        return self.meanwhile(draw)

    def told(self, bench: Bench, axis: str) -> int | None:
        if not hears(bench):
            return None
        place = len(bench.out)
        bench.play((Say(f"{axis}-1?"), Wait(2 * MS)))
        heard = bench.heard(place).strip("\r\n*")
        return int(heard.split(",")[2])

    def limits(self) -> Sequence[Limit]:
        return [self._limit(pin) for pin in LIMITS]

    def _limit(self, pin: str) -> Limit:
        axis, direction = pin[1], 1 if pin.endswith("+") else -1

        def steps(bench: Bench, rate: float) -> int:
            return 0 if self._hard else ramp_steps(rate, *ramp(bench, axis))

        def closed(bench: Bench) -> bool:  # in E mode a soft limit is ignored (page 26)
            ignored = not self._hard and bench.device.status(bench.now).state == "direct"
            mask = bench.device._limits._mask  # type: ignore[attr-defined]  # what a T in garbage chose (page 34)
            blocked, inverted = mask >> LIMITS.index(pin) & 1, mask >> 4 + LIMITS.index(pin) & 1
            return bench.level(pin) == (HIGH if inverted else LOW) and not ignored and not blocked

        return Limit(pin, axis, direction, closed, steps)


def mask(bench: Bench) -> tuple[bool, Level]:
    """What the last T made of the limits: whether they are blocked, and at which level they are active (page 34)."""
    bits = bench.device._limits._mask  # type: ignore[attr-defined]
    return bool(bits & 15), HIGH if bits & 240 else LOW


def hears(bench: Bench) -> bool:
    """Whether it takes commands: on, and not deaf behind a reset."""
    return bench.device.status(bench.now).state in ("ready", "running")


MODELS = (Board("bs0610", hard=False), Board("bs0710", hard=True))
