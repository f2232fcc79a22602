"""The SUPERSIGMA's drivers against emulated drives in virtual time."""

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


def test_a_line_of_several_axes_is_straight_to_less_than_a_step_of_each_pulse_by_pulse() -> None:
    for distances in ((1000, 700, -333), (500, 17, 0), (-300, 299, 298), (64, -64, 32)):
        cell, port = robot(switches=False)
        BlockingCcu(Ccu(), port).move_line(dict(enumerate(distances, 1)))
        assert positions(cell) == list(distances)
        check_straight(cell, distances)


def check_straight(cell: Cell, distances: tuple[int, ...]) -> None:
    """At every pulse of an axis the longest axis, evenly between its own pulses, is where the line says."""
    assert cell.recording is not None
    spans = [cell.recording.motion(f"m{n}", cell.now) for n in range(1, DRIVES + 1)]
    lead = max(range(len(distances)), key=lambda axis: abs(distances[axis]))

    def lead_at(t: int) -> float:
        place = 0.0
        for span in spans[lead]:
            if span.begins <= t:
                state = span.train.state_at(t)
                place = span.shaft + span.direction * (state.steps + state.phase)
        return place

    for axis, distance in enumerate(distances):
        for span in spans[axis] if distance else ():
            for n, t in enumerate(span.train.times().tolist(), 1):
                ideal = lead_at(t) * distance / distances[lead]
                assert abs(span.shaft + span.direction * n - ideal) < 1


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
