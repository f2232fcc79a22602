"""Law: whatever came over the MICROBUS before, a CCU that begins afterwards moves what it says, and stops what it says.

Nothing marks where a message begins (Cassinis, table 1): see `detent.hosts.microbus`.
"""

from collections.abc import Callable
from itertools import product
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.generated import examples
from tests.hosts.test_supersigma_cells import positions, robot

from detent.cell.cell import Cell
from detent.cell.faults import OnLine
from detent.cell.host import HostPort
from detent.hosts.errors import DriverError, MotionFailed
from detent.hosts.exchange import Ask, Steps
from detent.hosts.supersigma import BlockingCcu, BlockingSupersigma, Ccu, Supersigma
from detent.lines.faults import UNITS, LostCharacters
from detent.ticks import MS, SECOND, US


class Damaging(HostPort):
    """Write number `nth`, if it has `least` bytes, does not reach the bus, or comes as another: bit `bit` is wrong."""

    def __init__(self, cell: Cell, nth: int, bit: int | None, *, least: int = 0) -> None:
        super().__init__(cell)
        self.nth, self.bit, self.least, self.writes = nth, bit, least, 0

    def write(self, data: bytes) -> int:
        self.writes += 1
        if self.writes == self.nth and len(data) >= self.least:
            if self.bit is None:
                return len(data)
            place, bit = divmod(self.bit, 8)
            data = data[:place] + bytes([data[place] ^ 1 << bit]) + data[place + 1 :]
        return super().write(data)


GARBAGE = st.lists(st.sampled_from([0, 1, 2, 3, 5, 0x81, 0x83, 0xFF]) | st.integers(0, 255), max_size=9).map(bytes)
MOVES = st.lists(st.tuples(st.integers(1, 3), st.integers(-30, 30).filter(bool)), min_size=1, max_size=4)


def check_moves(garbage: bytes, moves: list[tuple[int, int]]) -> None:
    cell, port = robot(switches=False)
    cell.send(0, garbage)
    cell.run_to(cell.now + len(garbage) * 50 * US)
    ccu = BlockingCcu(Ccu(), port)
    for drive in (1, 2, 3):  # what the garbage itself has set in motion ends here
        ccu.stop(drive)
        while ccu.status(drive).moving:
            port.wait(0.05)
    places = positions(cell)
    for drive, steps in moves:
        ccu.move(drive, steps)
        ccu.wait_for(drive)
        places[drive - 1] += steps
    cell.run_to(cell.now + 10 * SECOND)
    assert positions(cell) == places


def check_stop(garbage: bytes, after: int) -> None:
    """A stop of a drive on a long movement, straight behind garbage."""
    cell, port = robot(switches=False)
    drive = BlockingSupersigma(Supersigma(1), port)
    drive.move(60_000)
    port.wait(after / 1000)
    cell.send(0, garbage)
    drive.stop()
    told = cell.now
    cell.run_to(told + 400 * MS)  # the ramp takes 0.3 s
    assert cell.controller("m1").status(cell.now).state == "ready"
    place = positions(cell)[0]
    cell.run_to(told + 10 * SECOND)
    assert positions(cell)[0] == place


@given(GARBAGE, MOVES)
@settings(max_examples=examples(40))
def test_whatever_came_before_a_ccu_moves_what_it_says(garbage: bytes, moves: list[tuple[int, int]]) -> None:
    check_moves(garbage, moves)


@given(GARBAGE, st.integers(0, 2000))
@settings(max_examples=examples(40))
def test_whatever_came_before_a_stop_stops(garbage: bytes, after: int) -> None:
    check_stop(garbage, after)


@pytest.mark.slow
@given(GARBAGE, MOVES)
@settings(max_examples=10_000)
def test_whatever_came_before_a_ccu_moves_what_it_says_at_length(garbage: bytes, moves: list[tuple[int, int]]) -> None:
    check_moves(garbage, moves)


@pytest.mark.slow
@given(GARBAGE, st.integers(0, 2000))
@settings(max_examples=10_000)
def test_whatever_came_before_a_stop_stops_at_length(garbage: bytes, after: int) -> None:
    check_stop(garbage, after)


def test_a_stray_byte_costs_a_question_and_moves_nothing() -> None:
    """Without the silence the question for status of drive 1 would be half a movement of drive 2."""
    cell, port = robot(switches=False)
    ccu = BlockingCcu(Ccu(), port)
    assert not ccu.status(1).moving
    cell.send(0, b"\x02")
    begin = cell.now
    assert not ccu.status(1).moving
    assert cell.now - begin < SECOND
    ccu.move_all({1: 7, 2: -9})
    assert positions(cell) == [7, -9, 0]


def test_a_stop_that_is_never_answered_is_an_error() -> None:
    _, port = robot()
    with pytest.raises(TimeoutError, match="drive 9: does not answer: it was told to stop 4 times and may still move"):
        BlockingCcu(Ccu(), port).stop(9)


def test_a_movement_of_no_steps_is_refused_and_told() -> None:
    cell, port = robot()
    cell.type("m1", "move +0")
    cell.run_to(SECOND)
    drive = BlockingSupersigma(Supersigma(1), port)
    with pytest.raises(MotionFailed, match="drive 1: refused a command"):
        drive.wait()
    with pytest.raises(ValueError, match="a movement has 1 to 65535 steps"):
        drive.move(0)


@pytest.mark.parametrize(("limit", "fastest"), [(300, 300), (600, 600), (700, 700)])
def test_a_limit_is_kept_below_the_lowest_speed_of_the_ramps_too(limit: int, fastest: int) -> None:
    cell, port = robot(switches=False)
    drive = BlockingSupersigma(Supersigma(1), port)
    drive.move(500, limit=limit)
    drive.wait()
    assert cell.recording is not None
    (span,) = cell.recording.motion("m1", cell.now)
    times = span.train.times(1, 500)
    assert (times[1:] - times[:-1]).min() >= SECOND / fastest * 0.999


@pytest.mark.parametrize("nth", range(1, 25))
def test_a_byte_that_is_lost_is_told_or_made_good(nth: int) -> None:
    """A movement that came to be another is not taken for the one that was told."""
    cell, port = robot(switches=False)
    drive = BlockingSupersigma(Supersigma(1), port)
    cell.breaks(OnLine(0, LostCharacters(UNITS, nth=nth)))
    made = 0
    for steps in (257, -60):
        try:
            drive.move(steps)
            drive.wait()
        except DriverError:
            break
        made += steps
        assert positions(cell)[0] == made
    drive.stop()
    cell.run_to(cell.now + SECOND)
    stood = positions(cell)
    cell.run_to(cell.now + 10 * SECOND)
    assert positions(cell) == stood


@pytest.mark.parametrize("nth", range(1, 17))
@pytest.mark.parametrize("bit", [None, *range(2, 8)], ids=lambda bit: "lost" if bit is None else f"to {1 ^ 1 << bit}")
def test_a_message_that_no_drive_takes_is_told_or_made_good(nth: int, bit: int | None) -> None:
    """Lost, or to a drive that is not there: status reads as if a movement of as many steps had been made (Status)."""
    cell, _ = robot(switches=False)
    drive = BlockingSupersigma(Supersigma(1), Damaging(cell, nth, bit))
    for steps in (20, -20, 20, 20):
        before = drive.position()
        try:
            drive.move(steps)
            drive.wait()
        except DriverError:
            assert drive.position() == positions(cell)[0] == before
        else:
            assert drive.position() == positions(cell)[0] == before + steps


@pytest.mark.parametrize("bit", [11, 12, 13, 14])
@pytest.mark.parametrize("nth", range(3, 9))
def test_a_question_that_is_damaged_in_a_movement_costs_no_step_of_the_position(nth: int, bit: int) -> None:
    """The question comes as an op-code that there is not, and leaves the flag of a refusal at a drive that moves."""
    cell, _ = robot(switches=False)
    drive = BlockingSupersigma(Supersigma(1), Damaging(cell, nth, bit))
    drive.move(6000)
    with pytest.raises(MotionFailed, match="refused a command"):
        drive.wait()
    assert drive.position() == positions(cell)[0] == 6000


class Misheard(HostPort):
    """In what is heard at the `nth` time one bit is wrong."""

    def __init__(self, cell: Cell, nth: int, bit: int) -> None:
        super().__init__(cell)
        self.nth, self.bit, self.times = nth, bit, 0

    def receive(self, timeout: float) -> bytes:
        data = super().receive(timeout)
        self.times += bool(data)
        if not data or self.times != self.nth:
            return data
        return bytes([data[0] ^ 1 << self.bit]) + data[1:]


@pytest.mark.parametrize("bit", range(8))
def test_an_answer_that_is_damaged_is_told_or_leaves_no_trace_in_the_position(bit: int) -> None:
    """An answer has no checksum. Nothing of it stays, and no call that returns has brought the drive elsewhere."""
    nth, whole = 0, False
    while not whole:
        nth += 1
        cell, _ = robot()
        port = Misheard(cell, nth, bit)
        drive, told = BlockingSupersigma(Supersigma(1), port), ""
        try:
            drive.home()
            drive.wait()
            for steps in (20, -20, 10):
                drive.move_by(steps)
                drive.wait()
        except DriverError as error:
            assert port.times >= nth
            told = str(error)
        else:
            assert positions(cell)[0] == 10
        cell.run_to(cell.now + 10 * SECOND)
        # an answer that was thrown away is asked for again behind a silence, when a short movement is over
        assert "if it did move" in told or drive.position() == positions(cell)[0]
        whole = port.times < nth
    assert nth > 30


@pytest.mark.parametrize("kind", ["drive", "ccu"])
def test_an_origin_that_was_found_before_is_none_that_was_found_now(kind: str) -> None:
    """Origination, "upon reception of a particular command": where that is lost the flag is of the search before."""
    nth, whole, told = 0, False, 0
    while not whole:
        nth += 1
        cell, port = robot()
        made = BlockingSupersigma(Supersigma(1), port) if kind == "drive" else BlockingCcu(Ccu(), port)

        def search(made: BlockingSupersigma | BlockingCcu = made) -> None:
            if isinstance(made, BlockingSupersigma):
                made.home()
                made.wait()
            else:
                made.originate_all([1])

        search()
        BlockingSupersigma(Supersigma(1), port).move(300)
        cell.run_to(cell.now + SECOND)
        made.port = lossy = Damaging(cell, nth, None)
        try:
            search()
        except MotionFailed:
            told += 1
            search()
        assert cell.controller("m1").status(cell.now).position == 0
        whole = lossy.writes < nth
    assert nth > 4
    assert told == 1


def starts(kind: str) -> list[Callable[[Any], Steps[Any]]]:
    """What begins a movement of 20 half steps, or an origination, of drive 1."""
    if kind == "drive":
        return [lambda drive: drive.move(20), lambda drive: drive.constant(-20, 600), lambda drive: drive.originate()]
    return [
        lambda ccu: ccu.move(1, 20),
        lambda ccu: ccu.move_constant(1, -20, 600),
        lambda ccu: ccu.originate(1),
        lambda ccu: ccu.move_all({1: -20, 2: 20}),
        lambda ccu: ccu.originate_all([1, 2]),
        lambda ccu: ccu.move_line({1: 20, 2: 20}),
        lambda ccu: ccu.move_line({1: 20, 2: 9}),
    ]


def begun_before(kind: str, cell: Cell, port: HostPort) -> Any:
    """A driver of drives 1 and 2, which have found their origins and made 20 half steps."""
    BlockingCcu(Ccu(), port).originate_all([1, 2])
    made: Any = BlockingSupersigma(Supersigma(1), port) if kind == "drive" else BlockingCcu(Ccu(), port)
    if kind == "drive":
        made.home()
        made.wait()
        made.move(20)
        made.wait()
    else:
        made.move_all({1: 20, 2: 20})
    return made


@pytest.mark.parametrize(("kind", "which"), [*product(["drive"], range(3)), *product(["ccu"], range(7))])
def test_a_call_that_was_broken_off_before_it_said_a_movement_raises_no_alarm(kind: str, which: int) -> None:
    """What the drive was made to refuse before is not told as a refusal; the movement behind it is one as any other."""
    behind, over = 0, False
    while not over:
        cell, port = robot()
        made = begun_before(kind, cell, port)
        stood, answer = positions(cell), None
        steps = starts(kind)[which](made.driver)
        for _ in range(behind):
            step = next(steps) if answer is None else steps.send(answer)
            if isinstance(step, Ask) and step.data[1:] not in (b"", b"\x05", b"\x78"):
                over = True  # it is said from here on, as far as the driver knows
                break
            answer = made._do(step)
        steps.close()
        if over:
            break
        behind += 1
        assert positions(cell) == stood
        if kind == "drive":
            made.wait()
            assert made.position() == stood[0]
            made.move(20)
            made.wait()
            assert made.position() == positions(cell)[0] == stood[0] + 20
        else:
            made.wait_for(1, 2)
            made.move_all({1: 20, 2: 20})
            assert positions(cell)[:2] == [place + 20 for place in stood[:2]]
    assert behind > 4


@pytest.mark.parametrize("which", range(3))
def test_a_single_movement_of_a_ccu_that_is_lost_is_told(which: int) -> None:
    """Also by `wait_for`, which is not told how many steps there were to be."""
    nth, whole, told = 0, False, 0
    while not whole:
        nth += 1
        cell, port = robot()
        made = begun_before("ccu", cell, port)
        stood = positions(cell)[0]
        made.port = lossy = Damaging(cell, nth, None)
        try:
            made.perform(starts("ccu")[which](made.driver))
            made.wait_for(1)
        except DriverError:
            assert positions(cell)[0] == stood
            told += 1
        else:
            assert positions(cell)[0] == (stood + 20, stood - 20, 0)[which]
        whole = lossy.writes < nth
    assert told == 1


@pytest.mark.parametrize("nth", range(1, 20))
def test_a_movement_of_a_ccu_that_is_lost_is_told(nth: int) -> None:
    cell, port = robot(switches=False)
    ccu = BlockingCcu(Ccu(), port)
    ccu.port = Damaging(cell, nth, None)
    places = [0, 0, 0]
    for steps in (20, -20, 30, -30):  # pick, place
        wanted = {1: steps, 2: -steps, 3: 2 * steps}
        try:
            ccu.move_all(wanted)
        except DriverError:
            return
        places = [place + step for place, step in zip(places, wanted.values(), strict=True)]
        assert positions(cell) == places


@pytest.mark.parametrize("distances", [(50, -50, 20), (30, 30, -30), (100, 33, 0)])
def test_a_movement_of_a_straight_line_that_is_lost_is_told(distances: tuple[int, ...]) -> None:
    """Whichever write does not come, out or back: a line that returns has been made."""
    nth, whole = 0, False
    while not whole:
        nth += 1
        cell, _ = robot(switches=False)
        port = Damaging(cell, nth, None)
        ccu = BlockingCcu(Ccu(), port)
        try:
            for way in (1, -1):
                ccu.move_line({drive: way * steps for drive, steps in enumerate(distances, 1)})
                assert positions(cell) == [max(way, 0) * steps for steps in distances]
        except DriverError:
            assert port.writes >= nth
        whole = port.writes < nth
    assert nth > 10


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize("distances", [(50, -50, 20), (100, 33, 20), (30, 30, -30)])
def test_a_line_told_twice_sees_that_one_drive_has_not_heard_its_first_movement(
    distances: tuple[int, ...], place: int
) -> None:
    """They are in one write; a drive that follows has last made as many steps as it begins with."""
    nth, whole, told = 0, False, 0
    while not whole:
        nth += 1
        cell, port = robot(switches=False)
        ccu = BlockingCcu(Ccu(), port)
        wanted = dict(enumerate(distances, 1))
        ccu.move_line(wanted)
        ccu.port = damaging = Damaging(cell, nth, 5 * 8 * place + 7, least=15)  # three messages
        try:
            ccu.move_line(wanted)
        except DriverError:
            told += 1
        else:
            assert positions(cell) == [2 * steps for steps in distances]
        whole = damaging.writes < nth
    assert told == 1
