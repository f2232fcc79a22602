"""When instructions run and trips are served, against a slow and plain model of the cycle (pages 27, 29, 32, 44, 49).

The model walks through the program once, instruction by instruction, and looks through the pulses of the motion, which
are those that the axis gave. It shares nothing with the firmware but the lengths and times of the table.
"""

from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.controllers.dcb274.bench_unit import Bench
from tests.controllers.dcb274.histories import executed
from tests.generated import examples

from detent.axis import MotionStarted
from detent.controllers.dcb274 import commands
from detent.controllers.dcb274.commands import ROWS, Instruction, Op
from detent.ticks import MS, SECOND, Ns

VECTOR = 100
LONGEST = 20 * SECOND


class Step(NamedTuple):
    """A pulse, and the place behind it."""

    at: Ns
    place: int


class Over(Exception):
    """The program has ended, or runs for longer than anybody looks."""


class Plain:
    """The cycle: fetch, wait for the action before, execute, wait as the instruction says. A trip is remembered."""

    def __init__(self, parts: dict[int, list[str]], trip: int, steps: list[Step], begun: Ns) -> None:
        self.code: dict[int, Instruction] = {}
        for address, lines in parts.items():
            for line in lines:
                instruction = commands.parse(line)
                self.code[address] = instruction
                address += ROWS[instruction.op].length
        self.steps = steps
        self.trips = [step.at for step in steps if step.place == trip]
        self.now, self.address, self.inside, self.left = begun, 0, False, None
        self.done: list[tuple[Ns, int]] = []
        self.ends = 0  # of the index under way, by the pulses that are still to come
        self.speed_at = 0  # when the ramp of the M under way is complete

    def serve(self) -> bool:
        """Whether a trip has come by now: then it is served, and what came in the routine behind that."""
        served = False
        while not self.inside and self.trips and self.trips[0] <= self.now:
            self.trips = [at for at in self.trips if at > self.now]
            self.inside, back, served = True, self.address, True
            self.address = VECTOR
            while self.one():
                pass
            self.inside, self.address = False, back
        return served

    def wait(self, until: Ns) -> None:
        """Wait; a trip is served in it, and the wait may be over behind it."""
        while True:
            self.serve()
            coming = [] if self.inside else [at for at in self.trips if self.now < at <= until]
            if not coming:
                self.now = max(self.now, until)
                return
            self.now = coming[0]

    def one(self) -> bool:
        """One instruction; False behind the last."""
        if self.now > LONGEST:
            raise Over
        found = self.code.get(self.address)
        length = ROWS[found.op].length if found else 1
        fetched = sum(not 128 <= byte < 192 for byte in range(self.address, self.address + length)) * MS
        self.now += fetched if found else max(fetched, 500_000)
        if found is None:
            return False
        again = True
        while again:
            again = False
            self.done.append((self.now, self.address))
            if ROWS[found.op].action:
                self.wait_for_action()
            self.now += ROWS[found.op].time
            match found.op:
                case Op.PLUS | Op.MINUS:
                    self.ends = self.last_pulse(found.values[0])
                case Op.WAIT:
                    self.wait(self.ends)
                    self.wait(self.now + 10 * MS * found.values[0])
                case Op.LOOP_ON_PORT if found.values[0] == 2048:
                    self.wait(LONGEST + 1)
                    raise Over
                case Op.LOOP_ON_PORT:
                    again = not self.serve()
                    if not again:
                        return True
                case Op.TRIP:
                    reached = [at for at in self.trips if at <= self.now]
                    later = [step.at for step in self.steps if step.place == found.values[0] and step.at > self.now]
                    self.trips = reached + later
                case Op.JUMP:
                    self.left = found.values[1] if self.left is None else self.left
                    if self.left:
                        self.left -= 1
                        self.address = found.values[0]
                        self.serve()
                        return True
                    self.left = None
        self.address += length
        self.serve()
        return True

    def wait_for_action(self) -> None:
        if self.ends > self.now:
            self.wait(self.ends)

    def last_pulse(self, count: int) -> Ns:
        """When the index that begins now is complete, by the pulses."""
        later = [step.at for step in self.steps if step.at > self.now]
        return later[count - 1] if count else self.ends

    def run(self) -> list[tuple[Ns, int]]:
        try:
            while True:
                while self.one():
                    pass
                self.wait(self.ends)  # a program lasts until its last motion is complete (page 27)
                if not self.serve():
                    return self.done
        except Over:
            return self.done


def pulses(bench: Bench) -> list[Step]:
    """The steps of all motions, which were never changed on their way."""
    found: list[Step] = []
    place = 0
    for motion in bench.of(MotionStarted):
        for pulse in range(1, (motion.train.steps or 0) + 1):
            place += motion.direction
            found.append(Step(motion.train.time_of(pulse), place))
    return found


def run(parts: dict[int, list[str]], trip: int) -> tuple[Bench, list[tuple[Ns, int]], Ns]:
    """The unit: what it executed, and when the program began."""
    bench = Bench()
    for address, lines in parts.items():
        bench.do(f"P {address}", *lines, "P", wait=20 * MS)
    bench.do(f"T {trip} {VECTOR}", wait=20 * MS)
    mark = len(bench.out)
    bench.say("G\r")
    begun = bench.now + 500_000
    bench.run_to(LONGEST + SECOND)
    return bench, [(event.at, event.address) for event in executed(bench, mark)], begun


INSTRUCTIONS = st.sampled_from(
    [
        "+ 5",
        "+ 40",
        "- 12",
        "+ 1",
        "+ 0",
        "W 0",
        "W 1",
        "W 3",
        "A 8",
        "A 0",
        "I 400",
        "I 900",
        "D 2",
        "b 3",
        "w 0",
        "E 1",
    ]
)
ROUTINES = st.lists(
    st.sampled_from(["A 16", "b 1", "W 0", "W 1", "I 700", "T 7 100", "T 20 100", "T 31 100"]), max_size=3
)
PROGRAMS = st.tuples(
    st.lists(INSTRUCTIONS, min_size=1, max_size=9),
    st.sampled_from([[], [], ["J 0 2"], ["L 2048 1"], ["W 5"]]),
    ROUTINES,
    st.integers(-10, 60),
)


def agrees(program: tuple[list[str], list[str], list[str], int]) -> None:
    """The unit executes what the plain model does, at the same times."""
    lines, last, routine, trip = program
    last = ["L 2048 0"] if last == ["L 2048 1"] else last
    parts = {0: [*lines, *last], VECTOR: routine}
    bench, found, begun = run(parts, trip)
    plain = Plain(parts, trip, pulses(bench), begun).run()
    assert found == plain


@given(program=PROGRAMS)
@settings(max_examples=examples(150), deadline=None)
def test_a_trip_is_served_when_the_manual_says(program: tuple[list[str], list[str], list[str], int]) -> None:
    agrees(program)


@pytest.mark.slow
@given(program=PROGRAMS)
@settings(max_examples=10_000, deadline=None)
def test_a_trip_is_served_when_the_manual_says_in_many_programs(
    program: tuple[list[str], list[str], list[str], int],
) -> None:
    agrees(program)


@pytest.mark.parametrize(
    ("program", "trip"),
    [
        (["+ 2000", "W 0"], 2),  # in the fetch of W
        (["+ 2000", "W 0"], 3),
        (["+ 3", "W 100"], 3),
        (["+ 900"], 1),
        (["+ 900", "I 900"], 6),  # in the fetch of the end
        (["+ 900"], 900),
        (["+ 900", "- 5"], 2),  # in the fetch of an action that waits
        (["M 2000", "L 2048 0"], 3),
    ],
)
def test_a_trip_in_the_fetch_or_execution_of_what_then_waits_is_served_in_the_wait(
    program: list[str], trip: int
) -> None:
    """Page 49: "when equality is detected, a trip event will be triggered"."""
    bench, found, _ = run({0: program, VECTOR: ["A 24"]}, trip)
    at = next(at for at, address in found if address == VECTOR)
    motion = bench.of(MotionStarted)[0]
    assert 2 * MS <= at - motion.train.time_of(trip) <= 9 * MS


def test_a_trip_that_is_reached_in_the_routine_is_served_behind_it() -> None:
    """Page 49: "the new trip cannot be triggered until the end of the first trip routine"."""
    parts = {0: ["+ 2000", "W 0"], VECTOR: ["T 30 100", "W 3", "A 16"]}
    bench, found, begun = run(parts, 2)
    assert [address for _, address in found] == [0, 4, *2 * [VECTOR, VECTOR + 5, VECTOR + 8]]
    assert found == Plain(parts, 2, pulses(bench), begun).run()
