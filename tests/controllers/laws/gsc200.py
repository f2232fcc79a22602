"""GS-C200 and GS-C200S, as their datasheet has them."""

from collections.abc import Mapping, Sequence
from random import Random
from typing import Any

from tests.controllers.laws.adapter import Limit, Redefinition, Stop
from tests.controllers.laws.bench import Action, Bench, Contact, Power, Put, Raw, Say, Wait

from detent.controllers.gsc200.firmware import GsC200
from detent.pins import HIGH, LOW
from detent.ticks import MS, SECOND, US, Ns

SETTINGS = ("S1", "S10", "S90", "T10", "T100", "T400", "T1000", "R1", "R50", "R400", "R999", "A1", "C1", "I2", "I3")
QUESTIONS = ("F", "V1", "V2", "Q", "Y9", "+0")
MOVES = ("+1", "+40", "-40", "+700", "-300", "+5000", "-5000", "+999999", "+2000")
OWN_MOVES = {
    "gs-c200": ("G0", "G900", "G9999999", "G+", "G-", "G+1", "G-2", "G+3"),
    "gs-c200s": ("G+0", "G-900", "G+8000000", "g+", "g-", "g+1", "g-2", "g+3"),
}
PROGRAMS = {
    "gs-c200": (("+500", "D1", "-500", "L3"), ("W1", "+300", "W2", "-300"), ("S20", "G+1", "D1", "G0"), ("U3", "+900"),
                ("T300", "R200", "+3000", "-3000", "L0", "A1", "D1", "C1", "L3")),
    "gs-c200s": (("+500", "D1", "-500", "j0"), ("W1", "+300", "W2", "-300"), ("S20", "g+1", "D1", "G+0"),
                 ("f100", "g-2"),
                 ("T300", "R200", "+3000", "-3000", "L0", "A1", "D1", "C1", "L3"),
                 ("jc7,4", "+9", "+800", "I1", "-800")),
}  # fmt: skip


def registers(bench: Bench) -> tuple[int, int, int]:
    """S and T in steps/s, and R: in force for the move under way, as nothing is set while one is."""
    found = bench.device.registers(bench.now)
    return 10 * int(found["S"]), 10 * int(found["T"]), int(found["R"])


def ramp_time(bench: Bench) -> Ns:
    """Z: "reduces the stepping rate to zero through a deceleration ramp"; at once in homing and without a ramp."""
    start, top, steps = registers(bench)
    rate = bench.travels[""].rate(bench.now) if bench.level("ENABLE") == HIGH else top
    if top <= start or course(bench) != "move":
        return 0
    # the ramp is one of constant deceleration; the pulse on its way keeps its time, and so does the one at the peak
    down = max(rate - start, 0) * 2 * steps / (top * top - start * start)
    return int((down + 3 / start) * SECOND) + bench.travels[""].interval(bench.now)


def ramp_steps(bench: Bench, rate: float) -> int:
    """Steps of the ramp down from a rate."""
    start, top, steps = registers(bench)
    if top <= start:
        return 0
    return int(steps * max(rate * rate - start * start, 0) / (top * top - start * start)) + 3


def at_once(bench: Bench) -> Ns:
    return 0


def course(bench: Bench) -> str:
    """What the axis is doing."""
    return str(bench.device._motion.course.value)  # type: ignore[attr-defined]


def homing(bench: Bench) -> bool:
    return course(bench).startswith("seek")


class Module:
    """A module without checksums."""

    axes = ("",)
    phases = ("rest", "a program at rest", "speeding up", "at speed", "slowing", "to the end of travel", "back home",
              "held")  # fmt: skip

    def __init__(self, name: str) -> None:
        self.name = name

    def options(self, draw: Random) -> Mapping[str, Any]:
        return draw.choice(({}, {}, {"recall": True}))

    def make(self, options: Mapping[str, Any]) -> GsC200:
        straps = {"CHS": 0, "REC": 0 if options.get("recall") else 1}
        return GsC200(self.name, straps, line_timing=False)

    def ready(self) -> Sequence[Action]:
        return ()

    def contacts(self, draw: Random) -> tuple[Contact, ...]:
        found = []
        for pin, away in (("EOT", 1), ("HOME", -1)):
            if draw.random() < 0.6:
                at = away * draw.randint(3, 900)
                low = at if away > 0 else at - 10**9
                found.append(Contact(pin, "", low, low + draw.choice((10**9, 10**9, 4))))
        return tuple(found)

    def actions(self, draw: Random) -> Sequence[Action]:
        match draw.randrange(16):
            case 0 | 1 | 2:
                return [Say(draw.choice(MOVES))]
            case 3 | 4 | 5:
                return [Say(draw.choice(OWN_MOVES[self.name]))]
            case 6 | 7:
                return [Say(draw.choice(SETTINGS)), Wait(2 * MS)]
            case 8:
                return [Say(draw.choice(("H", "H-", "W1", "W2", "D3", "K", "Z", "I1", "M", "X")))]
            case 9 | 10:
                enter = "P" if self.name == "gs-c200" else "Po"
                lines = draw.choice(PROGRAMS[self.name])
                return [*(Say(line) for line in (enter, *lines)), Say("E")]
            case 11 | 12:
                pin, level = draw.choice(("UI1", "UI2", "UI3")), draw.choice((LOW, HIGH))
                return [Put(pin, level)]
            case 13:
                pin = draw.choice(("UI1", "UI2", "UI3", "ENABLE", "ENABLE", "EOT", "HOME"))
                return [Put(pin, LOW), Wait(draw.choice((1, 16 * US, 5 * MS, 80 * MS))), Put(pin, HIGH)]
            case 14:
                return self.meanwhile(draw)
        return self._rare(draw)

    def _rare(self, draw: Random) -> Sequence[Action]:
        match draw.randrange(4):
            case 0:
                return [Power(False), Wait(1 * MS), Power(True), *self.ready()]
            case 1:
                return [Put("ENABLE", LOW)]
        return [Raw(bytes(draw.choices(b"KZF+9 ;\x80\xff", k=3)) + b"\r", draw.randrange(-1, 3))]

    def meanwhile(self, draw: Random) -> Sequence[Action]:
        return [Say(draw.choice(QUESTIONS))]

    def phase(self, bench: Bench, axis: str) -> str:
        travel = bench.travels[axis]
        if bench.level("ENABLE") == LOW and course(bench) != "rest":
            return "held"
        if not travel.moving:
            return "a program at rest" if bench.pin("RDY") == LOW else "rest"
        if homing(bench):
            return "to the end of travel" if course(bench) == "seek end of travel" else "back home"
        assert travel.motion is not None
        train, given = travel.motion.train, travel.given(bench.now)
        far = min(given + 2 * registers(bench)[2], train.steps or given + 2000)
        now = train.time_of(given + 1) - train.time_of(given) if far > given else 0
        then = train.time_of(far) - train.time_of(far - 1) if far > given + 1 else now
        return "at speed" if 0.98 < now / (then or 1) < 1.02 else "slowing" if then > now else "speeding up"

    def let_go(self, bench: Bench) -> Sequence[Action]:
        return ()

    def stops(self) -> Sequence[Stop]:
        enabled = lambda bench: bench.level("ENABLE") == HIGH  # noqa: E731
        return (
            Stop("K", "K", lambda bench: [Say("K")], at_once),
            Stop("Z", "Z", lambda bench: [Say("Z")], ramp_time, enabled),
            Stop("Z, then ENABLE", "Z", lambda bench: [Say("Z"), Put("ENABLE", HIGH)], ramp_time,
                 lambda bench: not enabled(bench)),
            Stop("power", "pin 27", lambda bench: [Power(False)], at_once),
            Stop("input", "Gsx, gsx", lambda bench: [Put(waited(bench), LOW)], ramp_time,
                 lambda bench: enabled(bench) and course(bench) == "move" and bool(waited(bench))
                 and len(bench.device._running._program.steps) == 1),  # type: ignore[attr-defined]
        )  # fmt: skip

    def meets(self, phase: str, stop: Stop) -> bool:
        match stop.name:
            case "Z":
                return phase != "held"
            case "Z, then ENABLE":
                return phase in ("held", "rest", "a program at rest")
            case "input":
                return phase in ("speeding up", "at speed", "slowing")
        return True

    @property
    def modulus(self) -> int:
        return 10_000_000 if self.name == "gs-c200" else 1 << 24

    def redefinition(self, draw: Random) -> Redefinition:
        if self.name == "gs-c200" or draw.random() < 0.3:
            return Redefinition("I1", "Ix", [Say("I1"), Wait(1 * MS)], [Say("I2"), Wait(1 * MS)], 0, ("",), idle)
        value = draw.choice((0, 1, 5, 100, -77, 4096, 8_388_607, -8_388_608))
        if draw.random() < 0.5:
            force, neutral = ([Say("Po"), Say(line), Say("+90"), Say("E"), Wait(SECOND * 30)]
                              for line in (f"f{value:+d}", "f+0"))  # fmt: skip
            return Redefinition("f", "fs", force, neutral, value, ("",), idle)
        return Redefinition("f", "fs", [Say(f"f{value:+d}")], [Say("f+0")], value, ("",), idle)

    def redefines(self, bench: Bench) -> bool:
        """I1, I3 and f; power; homing, when it is complete."""
        words = {action.text for action in bench.actions if isinstance(action, Say)}
        homes = bool(words & {"H", "H-"}) or self.name == "gs-c200s" or bench.device.straps["REC"] == LOW
        last = bench.actions[-1]
        return homes or isinstance(last, Power) or (isinstance(last, Say) and last.text in ("I1", "I3"))

    def onward(self, draw: Random) -> Sequence[Action]:
        moves = ("+1", "+40", "+700", "+9000", "F", "V2", "Z", "K", "S20", "A1", "Y9")
        own = ("-40", "g+", "g-2", "g+1") if self.name == "gs-c200s" else ()
        return [Say(draw.choice(moves + own))] if draw.random() < 0.8 else [Put("UI2", LOW), Wait(1), Put("UI2", HIGH)]

    def told(self, bench: Bench, axis: str) -> int | None:
        if bench.device.status(bench.now).state == "off":
            return None
        place = len(bench.out)
        bench.play((Say("V1"), Wait(1 * MS)))
        heard = bench.heard(place).strip("\r\n")
        return int(heard[1:]) if heard.startswith("V") else None

    def limits(self) -> Sequence[Limit]:
        def low(pin: str, *, met: str) -> Limit:
            def steps(bench: Bench, rate: float) -> int:
                return 0

            return Limit(pin, "", 0, lambda bench: bench.level(pin) == LOW, steps, False, lambda b: course(b) == met)

        def user(pin: str) -> Limit:
            return Limit(pin, "", 0, lambda bench: bench.level(pin) == LOW, ramp_steps, False,
                         lambda bench: course(bench) == "move" and waited(bench) == pin)  # fmt: skip

        return (
            Limit("ENABLE", "", 0, lambda bench: bench.level("ENABLE") == LOW, lambda bench, rate: 0, gate=True),
            low("EOT", met="seek end of travel"),
            low("HOME", met="seek home"),
            *(user(f"UI{n}") for n in (1, 2, 3)),
        )


def idle(bench: Bench) -> bool:
    """Whether it is ready for a command."""
    return bench.device.status(bench.now).state == "ready"


def waited(bench: Bench) -> str:
    """The user input that ends the velocity move under way."""
    return str(bench.device._running._waiting)  # type: ignore[attr-defined]


MODELS = (Module("gs-c200"), Module("gs-c200s"))
