"""The DCB-274, as its manual has it."""

from collections.abc import Mapping, Sequence
from math import sqrt
from random import Random
from typing import Any

from tests.controllers.laws.adapter import Limit, Redefinition, Stop
from tests.controllers.laws.bench import Action, Bench, Contact, Power, Put, Raw, Say, Wait

from detent.controllers.dcb274.firmware import Dcb274
from detent.pins import HIGH, LOW, Level
from detent.ticks import MS, SECOND, US, Ns

KEYS = ("JOG1", "JOG2", "JOG-S", "GO")  # levels that are looked at in the idle state (page 27)
SWITCHES = ("LIMIT-A", "LIMIT-B")
EXECUTION = 70 * MS  # the longest that a character waits for a command in hand: S, 60 ms (page 29), and its own
GENTLE = 32  # of l (page 46)
MOVES = ("+ 3", "+ 400", "+ 6000", "- 400", "- 6000", "R 0", "R -900", "R 2500", "M 900", "M 5000", "M -5000",
         "M 20000", "F 3000 0", "F 3000 1", "F 300 0", "F 20000 1", "+ 0", "M 900", "M -900")  # fmt: skip
SETTINGS = ("K 0 0", "K 5 5", "K 50 50", "K 3 20", "K 0 9", "I 40", "I 800", "I 3000", "V 10000", "V 300", "V 36000",
            "D 1", "D 3", "w 0", "w 20", "O 0", "O 500", "H 1", "H 3", "B 3 20", "B 100 200", "T 9 0", "S")  # fmt: skip
QUESTIONS = ("Z", "^", "A129", "] 0", "] 1", "[ 0 3", "A 8", "b 30", "E 1")
PROGRAMS = (
    ("P 0", "+ 900", "W 0", "- 300", "W 2", "G 0", "P"),
    ("P 0", "M 4000", "W 30", "M -4000", "W 30", "M 1000", "P"),
    ("P 0", "F 2000 0", "O 0", "+ 500", "P"),
    ("P 0", "T 300 100", "+ 2000", "W 0", "+ 200", "P", "P 100", "A 8", "P"),
    ("P 0", "+ 5000", "- 5000", "J 0 5", "P"),
    ("P 0", "M 3000", "L 2048 0", "@", "W 5", "+ 300", "P"),
    ("P 128", "+ 700", "W 0", "+ 700", "G 128", "P"),
)


def registers(bench: Bench) -> tuple[int, int, int, int, int]:
    """K up, K down, I, V and D."""
    found = bench.device.registers(bench.now)
    up, down = found["K"].split("/")
    return int(up), int(down), int(found["I"]), int(found["V"]), int(found["D"])


def flags(bench: Bench) -> int:
    """The options of `l`, as the last line that set them has it."""
    return int(bench.device._settings.flags)  # type: ignore[attr-defined]


def active(bench: Bench) -> Level:
    """The level at which a limit stops: with flag 1 "both inputs must be held low to allow a move" (page 45)."""
    return HIGH if flags(bench) & 1 else LOW


def ramp(rate: float, steps: int, initial: int, divide: int) -> tuple[int, Ns]:
    """Steps and time between a rate and rest: `steps` at each entry of the table below it, and at I (page 41).

    The speeds of the table are those of straight-line acceleration, 1095.4 sqrt(i) before they are divided.
    """
    entries = [initial]
    i = 1
    while (speed := 1095.4 * sqrt(i)) < rate * divide * 1.02:
        if speed > initial:
            entries.append(int(speed))
        i += 1
    time = sum(steps * divide / (entry * 0.98) for entry in entries)
    return steps * len(entries), int(time * SECOND)


def fastest(bench: Bench) -> float:
    """The largest rate that anything can have asked for so far."""
    typed = [abs(float(action.text.split()[1])) for action in bench.actions
             if isinstance(action, Say) and action.text[:2] in ("M ", "F ", "V ", "I ")]  # fmt: skip
    return max(10_500, *typed, 200 * 30 * 2 * 1.1) / registers(bench)[4]


def soft(bench: Bench) -> Ns:
    """Down the ramp from the rate that the axis has when the character has been taken; the pulse on its way before."""
    travel = bench.travels[""]
    _, down, initial, _, divide = registers(bench)
    match next((action.text.split() for action in reversed(bench.actions) if isinstance(action, Say)), []):
        case ["I", value]:  # it may be in hand still
            initial = min(initial, int(value))
        case ["K", _, value]:
            down = max(down, int(value))
        case ["D", value]:
            divide = max(divide, int(value))
    rate = max(travel.rate(bench.now), travel.rate(bench.now + EXECUTION), initial / divide)
    first = max(travel.interval(bench.now), int(2 * SECOND * divide / initial))
    return EXECUTION + first + ramp(rate, down, initial, divide)[1]


def soft_behind_a_ramp(bench: Bench) -> Ns:
    """The same when a ramp to a speed has to be completed before (page 28), through rest if it turns."""
    up, down, initial, _, divide = registers(bench)
    top = fastest(bench)
    wait = 2 * 10 * MS * 255  # w, before either direction
    return soft(bench) + wait + ramp(top, up, initial, divide)[1] + 2 * ramp(top, down, initial, divide)[1]


def pending(bench: Bench) -> bool:
    """Whether a line waits for its CR LF."""
    return bool(bench.device._desk.closed)  # type: ignore[attr-defined]


def state(bench: Bench) -> str:
    """The word that status has."""
    return bench.device.status(bench.now).state


def at_once(bench: Bench) -> Ns:
    return 0


def soft_or_pending(bench: Bench) -> Ns:
    waits = pending(bench) or bench.device._running._speeds_pending  # type: ignore[attr-defined]
    return soft_behind_a_ramp(bench) if waits else soft(bench)


class Axis:
    """A DCB-274, in single mode or on a party line."""

    axes = ("",)
    phases = ("rest", "a program at rest", "pre-energizing", "speeding up", "at speed", "slowing", "turning", "homing",
              "back home", "jogging", "pending", "a program moving")  # fmt: skip

    modulus = 1 << 24

    def __init__(self, name: str) -> None:
        self.name = name

    def options(self, draw: Random) -> Mapping[str, Any]:
        return draw.choice(({}, {}, {"party": True}))

    def make(self, options: Mapping[str, Any]) -> Dcb274:
        straps = {"PARTY": 1} if options.get("party") else None
        return Dcb274(straps, line_timing=False)

    def ready(self) -> Sequence[Action]:
        return (Raw(b" \n"),)  # signs on; on a party line a line begins behind LF

    def contacts(self, draw: Random) -> tuple[Contact, ...]:
        found = []
        if draw.random() < 0.3:
            at, width = draw.randint(5, 3000), draw.choice((0, 3, 50, 10**9))
            found.append(Contact("LIMIT-A", "", at, at + width))
        if draw.random() < 0.3:
            at, width = draw.randint(5, 3000), draw.choice((0, 3, 50, 10**9))
            found.append(Contact("LIMIT-B", "", -at - width, -at))
        if draw.random() < 0.5:
            at = draw.randint(-1500, 1500)
            found.append(Contact("HOME", "", at, at + draw.choice((2, 40, 10**9))))
        return tuple(found)

    def actions(self, draw: Random) -> Sequence[Action]:
        match draw.randrange(16):
            case 0 | 1 | 2 | 3 | 4:
                return [Say(draw.choice(MOVES))]
            case 5 | 6:
                return [Say(draw.choice(SETTINGS))]
            case 7:
                return [Say(draw.choice(("@", "M 0", "W 0", "W 30", "l 32", "l 0", "l 0", "l 1")))]
            case 8 | 9:
                lines = draw.choice(PROGRAMS)
                stored = [action for line in lines for action in (Say(line), Wait(20 * MS))]
                return [*stored, Say("G 128" if lines[0] == "P 128" else "G 0")]
            case 10 | 11:
                return [Put(draw.choice(KEYS), draw.choice((LOW, LOW, HIGH)))]
            case 12 | 13:
                pin = draw.choice((*KEYS, *SWITCHES, "SS", "P1", "HOME"))
                return [Put(pin, LOW), Wait(draw.choice((1, 16 * US, 5 * MS, 80 * MS))), Put(pin, HIGH)]
            case 14:
                return self.meanwhile(draw)
        return self._rare(draw)

    def _rare(self, draw: Random) -> Sequence[Action]:
        match draw.randrange(8):
            case 0:
                return [Power(False), Wait(1 * MS), Power(True), *self.ready()]
            case 5 | 6:  # a reversal takes its time (page 46)
                slope = Say(draw.choice(("K 20 20", "K 5 50", "K 50 5")))
                rates = draw.choice((("M 5000", "M -3000"), ("M -9000", "M 900")))
                return [slope, Wait(2 * MS), Say(rates[0]), Wait(draw.randrange(900) * MS), Say(rates[1]),
                        Wait(draw.randrange(60) * MS)]  # fmt: skip
            case 4 | 7:  # the current has fallen to hold: w waits (page 51)
                begun = draw.choice((Say(draw.choice(MOVES)), Say(draw.choice(MOVES)), Put("JOG1", LOW)))
                return [Say("w 20"), Wait(1200 * MS), begun, Wait(10 * MS)]
            case 1:
                return [Raw(b"\x03"), *self.ready()]
            case 2:
                return [Raw(b"\x1b")]
            case 3:
                return [action for _ in range(3) for action in (Put("STEP", LOW), Wait(90 * US), Put("STEP", HIGH))]
        return [Raw(bytes(draw.choices(b"xX+9 #;,@\x80\xff", k=3)) + b"\r\n", draw.randrange(-1, 3))]

    def meanwhile(self, draw: Random) -> Sequence[Action]:
        return [Say(draw.choice(QUESTIONS))]

    def phase(self, bench: Bench, axis: str) -> str:
        travel, word = bench.travels[axis], state(bench)
        if not travel.moving:
            return "a program at rest" if word == "running" else "rest"
        assert travel.motion is not None
        train, given = travel.motion.train, travel.given(bench.now)
        if train.time_of(0) > bench.now:
            return "pre-energizing"
        if bench.device._running.active:  # type: ignore[attr-defined]
            return "a program moving"
        if pending(bench):
            return "pending"
        if word == "homing":
            return "homing" if train.steps is None and bench.level("HOME") == HIGH else "back home"
        if any(bench.level(key) == LOW for key in ("JOG1", "JOG2")) and bench.device._motion.jogging:  # type: ignore[attr-defined]
            return "jogging"
        if bench.device._motion._reversed is not None:  # type: ignore[attr-defined]
            return "turning"
        far = min(given + 3000, train.steps or given + 3000)
        now = train.time_of(given + 1) - train.time_of(given) if far > given else 0
        then = train.time_of(far) - train.time_of(far - 1) if far > given + 1 else now
        return "at speed" if 0.98 < now / (then or 1) < 1.02 else "slowing" if then > now else "speeding up"

    def let_go(self, bench: Bench) -> Sequence[Action]:
        return [Put(key, HIGH) for key in KEYS if bench.level(key) == LOW]

    def stops(self) -> Sequence[Stop]:
        return (
            Stop("@ CR", "33", lambda bench: [Say("@")], soft_or_pending, listens),
            Stop("@", "28", lambda bench: [Raw(b"\nA@" if named(bench) else b"@")], soft_or_pending, closed),
            Stop("SS", "7, 28", lambda bench: [Put("SS", LOW)], soft_or_pending,
                 lambda bench: bench.level("SS") == HIGH and state(bench) != "off"),
            Stop("ESC", "33", lambda bench: [Raw(b"\x1b")], at_once),
            Stop("^C", "34", lambda bench: [Raw(b"\x03")], at_once),
            Stop("|", "57", lambda bench: [Raw(b"\nA|")], at_once, lambda bench: named(bench) and closed(bench)),
            Stop("power", "34", lambda bench: [Power(False)], at_once),
            Stop("M 0", "46", lambda bench: [Say("M 0")], soft_behind_a_ramp,
                 lambda bench: listens(bench) and not busy(bench) and bench.device._motion.status != 1),  # type: ignore[attr-defined]
            Stop("let go", "28, 36", self.let_go, soft,
                 lambda bench: any(bench.level(key) == LOW for key in ("JOG1", "JOG2"))
                 and bool(bench.device._motion.jogging), holding=True),  # type: ignore[attr-defined]
            Stop("limit", "7, 46", lambda bench: [Put(ahead(bench), LOW)],
                 lambda bench: soft(bench) if flags(bench) & GENTLE else 0, alone),
        )  # fmt: skip

    def meets(self, phase: str, stop: Stop) -> bool:
        match stop.name:
            case "@" | "|":
                return phase in ("rest", "pending", "pre-energizing", "a program moving", "a program at rest")
            case "M 0":
                return phase in ("rest", "speeding up", "at speed", "slowing", "turning", "pre-energizing")
            case "let go":
                return phase in ("jogging", "pre-energizing")
            case "limit":
                return phase not in ("rest", "a program at rest", "a program moving", "pending", "turning", "jogging")
        return phase != "jogging"

    def redefinition(self, draw: Random) -> Redefinition:
        value = draw.choice((0, 1, 5, 100, -77, 4096, 8_388_607, -8_388_607))
        return Redefinition("O", "47", [Say(f"O {value}"), Wait(1 * MS)], [Say("b 30"), Wait(1 * MS)], value, ("",),
                            lambda bench: listens(bench) and not busy(bench) and not absolute(bench)
                            and not bench.device._motion.jogging)  # type: ignore[attr-defined]  # fmt: skip

    def redefines(self, bench: Bench) -> bool:
        typed = [action for action in bench.actions[-12:] if isinstance(action, Say | Raw | Power)]  # O takes its time
        programs = any(isinstance(action, Say) and action.text == "O 0" for action in bench.actions)
        return (
            any(
                isinstance(action, Power)
                or (isinstance(action, Raw) and 3 in action.data)
                or (isinstance(action, Say) and action.text.startswith("O "))
                for action in typed
            )
            or programs
        )

    def onward(self, draw: Random) -> Sequence[Action]:
        match draw.randrange(8):
            case 0 | 1 | 2:
                return [Say(draw.choice(("+ 400", "- 90", "+ 3", "M 900", "M -5000", "M 0", "F 900 0", "H 1", "H 3")))]
            case 3:
                return [draw.choice((Say("@"), Raw(b"\x1b")))]
            case 4:
                pin = draw.choice((*KEYS[:3], *SWITCHES, "SS", "HOME"))
                return [Put(pin, LOW), Wait(80 * MS), Put(pin, HIGH)]
        return [Say(draw.choice(("^", "A129", "] 0", "A 8", "E 1")))]

    def told(self, bench: Bench, axis: str) -> int | None:
        if not listens(bench) or busy(bench) or bench.device._motion.jogging:  # type: ignore[attr-defined]
            return None
        place = len(bench.out)
        bench.play((Say("Z"), Wait(500 * US)))
        return int(bench.heard(place).strip("\r\n").split("Z")[1])

    def limits(self) -> Sequence[Limit]:
        def steps(bench: Bench, rate: float) -> int:
            _, down, initial, _, divide = registers(bench)
            return ramp(rate, down, initial, divide)[0] + 2 if flags(bench) & GENTLE else 0

        return (
            Limit("LIMIT-A", "", 1, lambda bench: bench.level("LIMIT-A") == active(bench), steps),
            Limit("LIMIT-B", "", -1, lambda bench: bench.level("LIMIT-B") == active(bench), steps),
        )


def absolute(bench: Bench) -> bool:
    """Whether something depends on the number of a position: a trip, the readout of Z 1."""
    return any(
        isinstance(action, Say) and action.text[:2] in ("T ", "k ", "i ", "Z ", "G ", "C ") for action in bench.actions
    )


def named(bench: Bench) -> bool:
    """Whether it is on a party line."""
    return bool(bench.device.mode.named)  # type: ignore[attr-defined]


def closed(bench: Bench) -> bool:
    """Whether single characters interrupt: in a pending period, in W, while a program runs (page 28)."""
    return pending(bench) or state(bench) == "running" or bool(bench.device._running.active)  # type: ignore[attr-defined]


def busy(bench: Bench) -> bool:
    """Whether a line is in hand, or a program runs."""
    return closed(bench) or bool(bench.device.answering)  # type: ignore[attr-defined]


def listens(bench: Bench) -> bool:
    """Whether a line is heard: signed on, not in program mode, no other line before it."""
    last = next((action.text for action in reversed(bench.actions) if isinstance(action, Say)), "")
    waits = bool(bench.device._inbox) or (last.startswith("P") and bench.device.answering)  # type: ignore[attr-defined]
    storing = bool(bench.device._desk.programming)  # type: ignore[attr-defined]
    return state(bench) not in ("waiting", "off") and not waits and not storing


def alone(bench: Bench) -> bool:
    """Whether the axis moves, nothing is pending, and the limit ahead is open."""
    motion = bench.device._motion  # type: ignore[attr-defined]
    free = not busy(bench) and motion._reversed is None
    return bool(bench.moving) and free and bench.level(ahead(bench)) == HIGH and active(bench) == LOW


def ahead(bench: Bench) -> str:
    """The limit towards which the axis moves: A stops plus, B minus (page 7)."""
    return "LIMIT-A" if bench.travels[""].direction > 0 else "LIMIT-B"


MODELS = (Axis("dcb-274"),)
