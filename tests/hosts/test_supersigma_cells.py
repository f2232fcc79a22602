"""The SUPERSIGMA's drivers against emulated drives in virtual time."""

from itertools import pairwise

import pytest

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.host import HostPort
from detent.hosts.axis import Limits, Speeds
from detent.hosts.errors import Busy, NoAnswer
from detent.hosts.supersigma import BlockingCcu, BlockingSupersigma, Ccu, DriveFailed, Report, Supersigma

DRIVES = 3


def robot(switches: bool = True) -> tuple[Cell, HostPort]:
    text = []
    for number in range(1, DRIVES + 1):
        text += [f"[units.m{number}]", 'model = "supersigma"', f"options = {{ number = {number} }}"]
        if switches:
            text += [
                f"[switches.s{number}]",
                f'drives = ["m{number}.RAIL"]',
                f'axis = "m{number}"',
                f"to = {-20 * number}",
            ]
    text += ["[lines.microbus]", f"units = {[f'm{n}' for n in range(1, DRIVES + 1)]}"]
    cell = build(parse("\n".join(text), "robot"), lambda file: "")
    return cell, HostPort(cell)


def positions(cell: Cell) -> list[int]:
    return [unit.status(cell.now).position for unit in cell.controllers().values()]


def test_the_ccu_drives_several_axes_at_once() -> None:
    cell, port = robot()
    ccu = BlockingCcu(Ccu(), port)
    assert all(report.originated for report in ccu.originate_all([1, 2, 3]).values())
    assert positions(cell) == [0, 0, 0]
    ccu.move_all({1: 6000, 2: 400, 3: 5})
    ccu.move_all({1: -1000, 2: 100}, limit=1000)
    assert positions(cell) == [5000, 500, 5]
    ccu.move(1, -5000)
    ccu.move_constant(2, -300, 600)
    ccu.stop(1)
    ccu.emergency(2)
    reports = ccu.wait_for(1, 2)
    assert 0 < reports[1].steps < 5000
    assert 0 < reports[2].steps < 300
    ccu.originate(3)
    assert ccu.wait_for(3)[3].originated


def travelled(cell: Cell, drive: int) -> tuple[list[int], list[int]]:
    """When each pulse of a drive came, and where it stood behind it."""
    assert cell.recording is not None
    times: list[int] = []
    places: list[int] = []
    for span in cell.recording.motion(f"m{drive}", cell.now):
        times += span.train.times(span.first, span.last).tolist()
        places += [span.shaft + span.direction * n for n in range(span.first, span.last + 1)]
    return times, places


def check_straight(cell: Cell, distances: tuple[int, ...]) -> None:
    """At every pulse, by where all axes stand then, in whole numbers: none is a step of its own from the line."""
    lead = max(range(len(distances)), key=lambda axis: abs(distances[axis]))
    far = abs(distances[lead])
    events = sorted(
        (at, axis, place)
        for axis in range(len(distances))
        for at, place in zip(*travelled(cell, axis + 1), strict=True)
    )
    stands = [0] * len(distances)
    for at, axis, place in events:
        stands[axis] = place
        for other, distance in enumerate(distances):
            off = abs(stands[other] * distances[lead] - stands[lead] * distance)
            assert off < far or abs(distance) == far == off, f"drive {other + 1} is {off}/{far} off at {at} ns"


@pytest.mark.parametrize(
    "distances",
    [(1000, 700, -333), (500, 17, 0), (-300, 299, 298), (64, -64, 32), (2345, 1289, -61), (400, 400, 400), (0, -9, 0)],
)
def test_a_line_of_several_axes_is_straight_to_less_than_a_step_pulse_by_pulse(distances: tuple[int, ...]) -> None:
    cell, port = robot(switches=False)
    ccu = BlockingCcu(Ccu(), port)
    ccu.move_line(dict(enumerate(distances, 1)))
    assert positions(cell) == list(distances)
    # back, with more questions, as the drives have made as many steps before
    ccu.move_line(dict(enumerate((-distance for distance in distances), 1)))
    assert positions(cell) == [0] * len(distances)
    check_straight(cell, distances)


def test_the_longest_axis_of_a_line_never_stops_and_the_line_takes_the_time_of_its_movement() -> None:
    cell, port = robot(switches=False)
    BlockingCcu(Ccu(), port).move_line({1: 5000, 2: 3217, 3: -1234})
    times, _ = travelled(cell, 1)
    assert {b - a for a, b in pairwise(times)} == {1_666_500}  # ns: N = 3332 at 600 half steps/s
    assert cell.now < 8.6 * 10**9  # 5000 half steps take 8.33 s


@pytest.mark.parametrize(("speed", "fastest"), [(600, 600), (3000, 2000)])
def test_a_line_of_equal_distances_has_ramps_where_it_is_faster_than_they_begin(speed: int, fastest: int) -> None:
    distances = (900, -900, 900)
    cell, port = robot(switches=False)
    BlockingCcu(Ccu(), port).move_line(dict(enumerate(distances, 1)), speed=speed)
    assert positions(cell) == list(distances)
    check_straight(cell, distances)
    times, _ = travelled(cell, 2)
    assert min(b - a for a, b in pairwise(times)) >= 10**9 / fastest * 0.999


def test_a_line_that_one_axis_leaves_is_stopped_on_all() -> None:
    cell, port = robot()
    with pytest.raises(DriveFailed, match="drive 2: met the end of its rail"):
        BlockingCcu(Ccu(), port).move_line({1: 5000, 2: -1217, 3: 800})
    cell.run_to(cell.now + 10**9)
    stood = positions(cell)
    assert stood[0] < 1000
    cell.run_to(cell.now + 10 * 10**9)
    assert positions(cell) == stood


def test_a_drive_that_is_not_there_is_given_up() -> None:
    cell, port = robot()
    ccu = BlockingCcu(Ccu(), port)
    with pytest.raises(NoAnswer, match="drive 9: does not answer"):
        ccu.status(9)
    assert ccu.status(1) == Report(0, 0)
    assert cell.now < 3 * 10**9


def test_a_drive_is_an_axis_whose_position_the_driver_counts() -> None:
    cell, port = robot()
    first, second = (BlockingSupersigma(Supersigma(number), port) for number in (1, 2))
    first.home()
    second.home()
    for drive in (first, second):
        drive.wait()
        assert drive.position() == 0
    first.move_to(6000)
    second.move_by(500)
    assert first.moving()
    with pytest.raises(Busy, match="drive 1: moves"):
        first.move_to(0)
    first.wait()
    second.wait()
    assert [first.position(), second.position()] == positions(cell)[:2] == [6000, 500]
    assert first.set_speeds(Speeds(650, 2000, 0.3)).slew == 2000
    first.move_to(1000)
    port.wait(0.5)
    first.stop()
    first.wait()
    assert first.position() == positions(cell)[0] > 1000
    first.set_position(50)
    first.constant(-20, 600)
    first.wait()
    assert first.position() == 30
    second.move_by(-500)
    second.halt()
    second.wait()
    assert second.position() == positions(cell)[1]


def test_the_end_of_the_rail_is_an_error_of_the_movement_and_a_limit_of_the_axis() -> None:
    cell, port = robot()
    drive = BlockingSupersigma(Supersigma(3), port)
    drive.move_by(-6000)
    with pytest.raises(DriveFailed, match=r"drive 3: met the end of its rail after .* steps") as caught:
        drive.wait()
    assert caught.value.report.steps == -drive.position()
    assert drive.limits() == Limits(low=True, high=False)
    assert drive.position() == positions(cell)[2]


def test_the_calls_of_a_drive_itself() -> None:
    _, port = robot()
    drive = BlockingSupersigma(Supersigma(1), port)
    drive.originate()
    drive.wait()
    drive.move(400, limit=1000)
    drive.emergency()
    drive.wait()
    assert 0 < drive.status().steps < 400
    assert drive.status().originated
