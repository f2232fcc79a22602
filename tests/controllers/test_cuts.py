"""`cuts` against its definition: a copy is given the level, and its next pulse does not come.

For every input of a device in a generated state: would the pulse that comes next still come if the input changed now?
A motion that goes on in the same direction, at whatever pace, is not cut; one that is held, ends, or turns round at
once is. What a program does that the input has set going is the program's, however soon it comes.
"""

import copy
from itertools import takewhile

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from tests.controllers.conformance import Candidate, Power, Received, Run, Schedule, schedules
from tests.controllers.dcb274.inputs import CANDIDATES as DCB274
from tests.controllers.test_conformance import CANDIDATES

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.controllers.device import Controller, Executing, Stop
from detent.ticks import MS, NEVER, Ns
from detent.uart import Char

DRIVEN = [candidate for candidate in (*CANDIDATES, *DCB274) if hasattr(candidate.make(), "cuts")]
every_controller = pytest.mark.parametrize("candidate", DRIVEN, ids=[candidate.name for candidate in DRIVEN])


def under_way(run: Run, axis: str) -> MotionStarted | None:
    """The motion of an axis, if one is under way and not held."""
    found: MotionStarted | None = None
    for item in run.out:
        if isinstance(item, (MotionStarted, MotionCut, MotionEnded)) and item.axis == axis:
            found = item if isinstance(item, MotionStarted) else None
    return found


def next_pulse(motion: MotionStarted, now: Ns) -> Ns:
    given = max(motion.train.steps_by(now), motion.first - 1)
    if motion.train.steps is not None and given >= motion.train.steps:
        return NEVER
    return motion.train.time_of(given + 1)


def by_asking_a_copy(run: Run, axis: str) -> set[Stop] | None:
    """The definition. None where the motion changes before its next pulse whatever the inputs do."""
    motion = under_way(run, axis)
    if motion is None:
        return set()
    due = next_pulse(motion, run.now)
    plain = run.fork()
    plain.go_to(due)
    after = [item for item in plain.out[len(run.out) :] if getattr(item, "axis", None) == axis]
    moves = [item for item in after if isinstance(item, (MotionStarted, MotionCut, MotionEnded))]
    if moves and moves[0].at < due:
        return None
    if moves and isinstance(moves[0], MotionCut):
        return set()  # it is held already
    found = set()
    for pin in run.candidate.pins:
        for level in (0, 1):
            twin = run.fork()
            twin.device.set_pin(pin, level, twin.now)
            twin.collect()
            twin.go_to(due)
            told = list(takewhile(lambda item: not isinstance(item, Executing), twin.out[len(run.out) :]))
            told = [item for item in told if getattr(item, "axis", None) == axis]
            told = [item for item in told if isinstance(item, (MotionStarted, MotionCut, MotionEnded))]
            for place, item in enumerate(told):
                if isinstance(item, MotionCut):
                    later = told[place + 1] if place + 1 < len(told) else None
                    goes_on = isinstance(later, MotionStarted) and later.at == item.at
                    if not (goes_on and later.direction == motion.direction):
                        found.add(Stop(pin, level))
                    break
                break  # it ends, or goes on in another way: what a command that waited for that does then is its own
    return found


def starts(model: str) -> st.SearchStrategy[bytes]:
    """Command lines that move an axis of the model, most of the time."""
    if model.startswith("gs-c200"):
        velocity = ["g+1", "g-2"] if model == "gs-c200s" else ["G+1", "G+2"]
        ramps = st.sampled_from([["S40"], ["S5", "T40", "R20"], ["S100", "T50"]])
        moves = st.sampled_from([["H"], ["H+"], ["H-"], ["+500"], [velocity[0]], [velocity[1]], ["+30"]])
        return st.builds(lambda ramp, move: "".join(f"{line}\r" for line in ramp + move).encode(), ramps, moves)
    if model == "dcb-274":
        flags = st.sampled_from(["", "l 32\r", "l 8\r", "l 1\r", "l 33\r", "w 20\r"])
        moves = ["F 400 0", "F 900 1", "+500", "-500", "M 900", "M -700", "F 300 1\r@", "M 500\rM -500"]
        return st.builds(lambda flag, move: f" {flag}{move}\r".encode(), flags, st.sampled_from(moves))
    if model == "supersigma":
        moves = [b"\x01\x81\x02\x58", b"\x01\x04", b"\x01\x04", b"\x01\x01\x01\x00", b"\x01\x02\x00\x90\x20"]
        return st.sampled_from(moves)
    moves = [
        "X900R5000G",
        "B2000G",
        "Y-3000G",
        "X+S",
        "B-S",
        "X400K300R-S",
        "B80K80R+S",
        "X900G-900G",
        "16T+S",
        "X62500P+SZ",
    ]
    return st.sampled_from(moves).map(str.encode)


def moving(candidate: Candidate, model: str) -> st.SearchStrategy[Schedule]:
    """Schedules that begin with a motion; the first pulses come before anything else does."""
    quiet = st.sampled_from([1 * MS, 12 * MS, 40 * MS, 150 * MS, 400 * MS])

    def begun(data: bytes, wait: Ns, rest: Schedule) -> Schedule:
        chars = [(25 * MS if n else 300 * MS, Received((Char(value),))) for n, value in enumerate(data)]
        return [
            (0, Power(True)),
            *chars,
            *[(wait if n == 0 else gap, action) for n, (gap, action) in enumerate(rest[1:])],
        ]

    return st.builds(begun, starts(model), quiet, schedules(candidate))


def check(candidate: Candidate, data: st.DataObject) -> int:
    """Compare at every step of one generated schedule; how many states there were in which something cuts."""
    model = candidate.make().model  # type: ignore[attr-defined]
    schedule = data.draw(schedules(candidate) | moving(candidate, model) | moving(candidate, model), label="schedule")
    run = Run(candidate, candidate.make())
    seen = 0
    for gap, action in schedule:
        run.go_to(run.now + gap)
        run.do(action)
        device: Controller = run.device  # type: ignore[assignment]
        for axis in device.axes:
            if not run.device.cuts(run.now, axis) and under_way(run, axis) is None:  # type: ignore[attr-defined]
                continue
            before = copy.deepcopy(device)
            told = device.cuts(run.now, axis)
            assert len(told) == len(set(told))
            expected = by_asking_a_copy(run, axis)
            if expected is None:
                continue
            assert set(told) == expected, f"{axis} at {run.now}"
            assert before.cuts(run.now, axis) == told, "asking changed it"
            assert {stop.pin for stop in told} <= set(candidate.pins)
            seen += bool(expected)
    return seen


@every_controller
@settings(max_examples=8, phases=(Phase.generate,), suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_cuts_are_what_a_copy_shows(candidate: Candidate, data: st.DataObject) -> None:
    check(candidate, data)


@pytest.mark.slow
@every_controller
@settings(max_examples=700, phases=(Phase.generate,), suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_cuts_are_what_a_copy_shows_in_many_states(candidate: Candidate, data: st.DataObject) -> None:
    check(candidate, data)
