"""Generated histories of a DCB-274: what is typed, pressed and switched, one thing after the other."""

import copy
from typing import NamedTuple

from hypothesis import strategies as st
from tests.controllers.dcb274.bench_unit import Bench

from detent.controllers.dcb274.desk import Stage
from detent.controllers.dcb274.link import Mode
from detent.controllers.device import Executing
from detent.ramps.timer_table import TICK, count_of, ladder
from detent.ticks import MS, Ns

MOVES = (
    "+2000", "+1", "-700", "+0", "R 0", "R 300", "R -50", "M 3000", "M -3000", "M 900", "M 0", "M 12000", "F 10000 0",
    "F 2000 1", "F 500 0", "W", "W 3", "@", "H 2",
)  # fmt: skip
SETTINGS = (
    "K 20 20", "K 1 30", "K 0 0", "K 5 5", "V 4000", "V 12000", "I 400", "I 3000", "D 2", "D 1", "w 5", "w 20", "w 0",
    "B 10 40", "O 0", "O -77", "T 25 128", "T 40 0", "l 0", "l 1", "l 32", "l 2", "Y 10 20", "A 8", "Z", "S", "C 0",
)  # fmt: skip
PROGRAMS = (
    ("P 128", "O 0", "+5", "P", "T 30 128", "P 0", "+400", "W 1", "-400", "W 0", "G 0", "P"),
    ("P 0", "M 3000", "L 2048 0", "M -3000", "L 4 1", "P"),
    ("P 0", "F 8000 0", "O 0", "R 500", "W 50", "P"),
    ("P 0", "w 9", "M -2000", "W 20", "M 900", "M 5000", "W 30", "P"),
    ("P 0", "+30", "J 0 50", "P"),
)
SWITCHES = ("LIMIT-A", "LIMIT-B", "HOME", "SS", "GO", "JOG1", "JOG2", "JOG-S", "P1", "STEP", "DIR")
SOON = (0, 0, 1, 200_000, 1 * MS, 3 * MS, 8 * MS, 20 * MS, 60 * MS, 150 * MS, 400 * MS, 2_500 * MS)


class Action(NamedTuple):
    """Something that somebody does, so long after the thing before."""

    wait: Ns
    what: str  # characters; or a pin and its level
    level: int | None = None


def actions(*more: str, switches: tuple[str, ...] = SWITCHES) -> st.SearchStrategy[Action]:
    """Command lines, programs and levels."""
    line = st.sampled_from([*MOVES, *MOVES, *SETTINGS, *more, "G", "G"]).map(lambda text: text + "\r")
    wait = st.sampled_from(SOON)
    return st.one_of(
        st.builds(Action, wait, line),
        st.builds(Action, wait, line),
        st.builds(Action, wait, st.sampled_from(switches), st.sampled_from((0, 1))),
    )


def histories(most: int = 12) -> st.SearchStrategy[tuple[tuple[str, ...], list[Action]]]:
    """A stored program, and what happens then."""
    return st.tuples(st.sampled_from(PROGRAMS), st.lists(actions(), max_size=most))


def begun(program: tuple[str, ...]) -> Bench:
    """A unit that holds a program."""
    key = " ".join(program)
    if key not in _BEGUN:
        bench = Bench()
        for line in program:
            assert bench.do(line, wait=50 * MS) == line + "\r\n"
        _BEGUN[key] = bench
    return copy.deepcopy(_BEGUN[key])


_BEGUN: dict[str, Bench] = {}


def do(bench: Bench, action: Action) -> None:
    """Let time pass, then do it."""
    bench.run_to(bench.now + action.wait)
    if action.level is None:
        bench.say(action.what)
    else:
        bench.pin(action.what, action.level)


def shaft(bench: Bench) -> int:
    """Where the motor is, whatever the counter says."""
    return bench.unit._axis.shaft_at(bench.now)


def stops(bench: Bench) -> list[str]:
    """The stops that the manual has for the state the unit is in."""
    desk, found = bench.unit._desk, ["ESC", "SS", "SS for a moment", "^C"]
    listens = bench.unit.mode is Mode.SINGLE and desk.stage not in (Stage.LISTING, Stage.NAMING)
    if listens and not desk.programming:
        found += ["@", "@"]
    return found


def stop(bench: Bench, how: str) -> None:
    """Do it as a person or a host does."""
    match how:
        case "SS" | "SS for a moment":
            bench.pin("SS", 1)
            bench.pin("SS", 0)
            if how != "SS":
                bench.run_to(bench.now + 100_000)
                bench.pin("SS", 1)
        case "^C":
            for contact in ("GO", "JOG1", "JOG2"):  # a reset looks at them as power-on does (page 34)
                bench.pin(contact, 1)
            bench.say("\x03")
        case "ESC":
            bench.say("\x1b")
        case _:
            bench.say("@\r")


def longest_stop(bench: Bench) -> Ns:
    """A pulse on its way, a ramp to speed that is completed before (page 28), a ramp to rest, commands in hand."""
    registers = bench.unit._settings
    ramp = sum(ladder(registers.initial, registers.divide).periods) * TICK
    pulse = max(bench.unit._motion.period(bench.now), count_of(40)) * TICK * 2
    return ramp * sum(registers.ramp) + pulse + 70 * MS


def motions(bench: Bench, since: int) -> list[object]:
    """What the axis did, of the outputs from `since` on."""
    return [o for o in bench.out[since:] if type(o).__name__.startswith("Motion")]


def executed(bench: Bench, since: int) -> list[Executing]:
    """Instructions of a program."""
    return [o for o in bench.out[since:] if isinstance(o, Executing)]
