"""The SUPERSIGMA drive, as its paper and our op-codes have it."""

from collections.abc import Mapping, Sequence
from random import Random
from typing import Any

from tests.controllers.laws.adapter import Limit, Redefinition, Stop
from tests.controllers.laws.bench import Action, Bench, Contact, Power, Put, Raw, Say, Wait

from detent.controllers.supersigma.firmware import Supersigma
from detent.pins import HIGH, LOW
from detent.ramps.ways import Way
from detent.ticks import MS, US, Ns

TABLE: Ns = 232 * 1290 * US  # "once every 1.29 ms" ("Long movements"): all of the table
SLOWEST: Ns = 21 * MS  # two periods of the slowest pulse: 100 half steps/s, speed 1 of op-code 02h
STEPS = (1, 2, 60, 403, 404, 900, 3000, 5143, 5144, 9000, 30_000, 65_535)
QUESTIONS = ("status", "status", "move +0", "constant +9 0")


def table_back(bench: Bench) -> Ns:
    """06h: the table is run back at the normal interval."""
    return TABLE + SLOWEST


def steepest(bench: Bench) -> Ns:
    """07h and the two inputs: "reducing the length of the intervals between loads"."""
    return TABLE // bench.device._motion._program.braking + SLOWEST  # type: ignore[attr-defined]


def at_once(bench: Bench) -> Ns:
    return 0


def homing(bench: Bench) -> bool:
    return bench.device.status(bench.now).state == "homing"


class Drive:
    """A drive; its number is 1."""

    name = "supersigma"
    axes = ("",)
    phases = ("rest", "speeding up", "at speed", "slowing", "braking", "to the switch", "from the switch")

    def options(self, draw: Random) -> Mapping[str, Any]:
        return draw.choice(({}, {}, {"short": Way.EXACT}, {"short": Way.FREE, "offset": 4}, {"braking": 100}))

    def make(self, options: Mapping[str, Any]) -> Supersigma:
        return Supersigma(number=1, line_timing=False, **options)

    def ready(self) -> Sequence[Action]:
        return ()

    def contacts(self, draw: Random) -> tuple[Contact, ...]:
        if draw.random() < 0.5:
            return ()
        at = draw.choice((-1, -30, -700, 40, 5000))
        low, high = (at - 10**9, at) if at < 0 else (at, at + 10**9)
        return (Contact("RAIL", "", low, high) if draw.random() < 0.7 else Contact("RAIL", "", at, at + 3),)

    def actions(self, draw: Random) -> Sequence[Action]:
        steps = draw.choice(STEPS) * draw.choice((1, -1))
        speed = draw.choice((1, 6, 7, 30, 90, 150, 255))
        match draw.randrange(12):
            case 0 | 1 | 2 | 3:
                return [Say(f"move {steps:+d}")]
            case 4:
                return [Say(f"constant {steps:+d} {speed}")]
            case 5 | 6:
                return [Say(f"limit {steps:+d} {speed}")]
            case 7:
                return [Say("originate")]
            case 8:
                return [Say(draw.choice(("stop", "emergency")))]
            case 9:
                pin = draw.choice(("RAIL", "FORCE"))
                return [Put(pin, LOW), Wait(draw.choice((1, 16 * US, 5 * MS, 80 * MS))), Put(pin, HIGH)]
            case 10:
                return self.meanwhile(draw)
        return self._rare(draw)

    def _rare(self, draw: Random) -> Sequence[Action]:
        match draw.randrange(3):
            case 0:
                return [Power(False), Wait(1 * MS), Power(True)]
            case 1:
                return [Put(draw.choice(("RAIL", "FORCE")), LOW)]
        return [Raw(bytes((2, draw.choice((1, 0x81)))) + draw.randbytes(2)), Raw(b"\x03\x05")]  # to other drives

    def meanwhile(self, draw: Random) -> Sequence[Action]:
        return [Say(draw.choice(QUESTIONS))]

    def phase(self, bench: Bench, axis: str) -> str:
        travel = bench.travels[axis]
        if not travel.moving:
            return "rest"
        word = str(bench.device._motion.course.value)  # type: ignore[attr-defined]
        if "switch" in word:
            return "to the switch" if word.startswith("to") else "from the switch"
        if word == "braking":
            return word
        now, then = travel.rate(bench.now), travel.rate(bench.now + 4 * MS)
        return "at speed" if 0.98 < now / (then or 1) < 1.02 else "slowing" if then < now else "speeding up"

    def let_go(self, bench: Bench) -> Sequence[Action]:
        return ()

    def stops(self) -> Sequence[Stop]:
        return (
            Stop("stop", "06h", lambda bench: [Say("stop")], table_back),
            Stop("emergency", "07h", lambda bench: [Say("emergency")], steepest),
            Stop("RAIL", "Emergency braking", lambda bench: [Put("RAIL", LOW)], steepest,
                 lambda bench: not homing(bench) and bench.level("RAIL") == HIGH),
            Stop("FORCE", "Emergency braking", lambda bench: [Put("FORCE", LOW)], steepest,
                 lambda bench: bench.level("FORCE") == HIGH),
            Stop("power", "Status", lambda bench: [Power(False)], at_once),
        )  # fmt: skip

    def meets(self, phase: str, stop: Stop) -> bool:
        return not (stop.name == "RAIL" and phase in ("to the switch", "from the switch"))

    modulus = 1 << 40

    def redefinition(self, draw: Random) -> Redefinition | None:
        return None  # "it is impossible to know the position": origination is its one way

    def redefines(self, bench: Bench) -> bool:
        """Power, and the origin, when it is found."""
        return isinstance(bench.actions[-1], Power) or Say("originate") in bench.actions

    def onward(self, draw: Random) -> Sequence[Action]:
        return ()

    def told(self, bench: Bench, axis: str) -> int | None:
        return None

    def limits(self) -> Sequence[Limit]:
        def steps(bench: Bench, rate: float) -> int:
            return int(rate * steepest(bench) / 10**9) + 3

        def brakes(pin: str) -> Limit:
            return Limit(pin, "", 0, lambda bench: bench.level(pin) == LOW, steps, False,
                         lambda bench: pin == "FORCE" or not homing(bench))  # fmt: skip

        to_switch = Limit("RAIL as a switch", "", -1, lambda bench: bench.level("RAIL") == LOW, lambda bench, rate: 0,
                          False, homing)  # fmt: skip
        return (brakes("RAIL"), brakes("FORCE"), to_switch)


MODELS = (Drive(),)
