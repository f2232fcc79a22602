"""The CCU's driver: its bytes, and its work with drives in virtual time (Cassinis, table 1; the codes are ours)."""

import pytest

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.host import HostPort
from detent.hosts.ccu import Ccu, DriveFailed, Report


class Wire:
    """Keeps what is written and answers what it was given."""

    def __init__(self, *answers: bytes) -> None:
        self.written, self.answers, self.waited = b"", b"".join(answers), 0.0

    def write(self, data: bytes) -> None:
        self.written += data

    def read(self, count: int) -> bytes:
        data, self.answers = self.answers[:count], self.answers[count:]
        return data

    def wait(self, seconds: float) -> None:
        self.waited += seconds


def driven(*answers: bytes) -> tuple[Wire, Ccu]:
    wire = Wire(*answers)
    return wire, Ccu(wire, wire.wait)


def test_the_bytes_of_every_command() -> None:
    wire, ccu = driven(bytes([0x14, 0x18, 0x09]))
    ccu.move(3, 5144)
    ccu.move(3, -5144, limit=2000)
    ccu.move_constant(4, -1, 600)
    ccu.originate(1)
    ccu.stop(2)
    ccu.emergency(255)
    assert ccu.status(7) == Report(5144, 9)
    assert wire.written.hex(" ") == "03 01 14 18 03 83 14 18 14 04 82 00 01 06 01 04 02 06 ff 07 07 05"


def test_the_flags_have_names() -> None:
    report = Report(0, 0x1F)
    names = ("moving", "end_of_rail", "excessive_force", "originated", "refused")
    assert all(getattr(report, name) for name in names)
    for bit, name in enumerate(names):
        assert [other for other in names if getattr(Report(0, 1 << bit), other)] == [name]


@pytest.mark.parametrize(
    ("deed", "message"),
    [
        (lambda ccu: ccu.move(1, 0), "1 to 65535 steps, .* not 0"),
        (lambda ccu: ccu.move(1, 65_536), "not 65536"),
        (lambda ccu: ccu.move(256, 1), "a number of 0 to 255, not 256"),
        (lambda ccu: ccu.move_constant(1, 1, 650), "a multiple of 100 half steps/s up to 25500, not 650"),
        (lambda ccu: ccu.move(1, 1, limit=0), "not 0"),
        (lambda ccu: ccu.move_line({1: 5, 2: 70_000}), "not 70000"),
    ],
)
def test_what_the_bus_cannot_say_is_refused_at_once(deed, message: str) -> None:  # type: ignore[no-untyped-def]
    wire, ccu = driven()
    with pytest.raises(ValueError, match=message):
        deed(ccu)
    assert wire.written == b""


def test_a_drive_that_does_not_answer_is_an_error_of_its_own() -> None:
    for answer in (b"", b"\x01\x02"):
        with pytest.raises(DriveFailed, match=r"drive 5 does not answer status: .* came, and not 3 bytes"):
            driven(answer)[1].status(5)


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (2, "met the end of its rail after 7 steps"),
        (4, "met excessive force after 7 steps"),
        (0x10, "refused a command"),
    ],
)
def test_waiting_ends_with_an_error_when_a_drive_tells_of_trouble(flags: int, message: str) -> None:
    with pytest.raises(DriveFailed, match=f"drive 2 {message}") as caught:
        driven(bytes([0, 7, flags]))[1].wait_for(2)
    assert caught.value.report == Report(7, flags)


def test_waiting_asks_again_while_a_drive_moves() -> None:
    wire, ccu = driven(bytes([0, 1, 1]), bytes([0, 9, 0]), bytes([0, 8, 0]))
    assert ccu.wait_for(1, 2) == {1: Report(8, 0), 2: Report(9, 0)}
    assert wire.waited == 0.02


DRIVES = 3


def robot(switches: bool = True) -> tuple[Cell, Ccu]:
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
    port = HostPort(cell)
    return cell, Ccu(port, port.wait)


def positions(cell: Cell) -> list[int]:
    return [unit.status(cell.now).position for unit in cell.controllers().values()]


def test_it_drives_several_axes_at_once() -> None:
    cell, ccu = robot()
    assert all(report.originated for report in ccu.originate_all([1, 2, 3]).values())
    assert positions(cell) == [0, 0, 0]
    ccu.move_all({1: 6000, 2: 400, 3: 5})
    ccu.move_all({1: -1000, 2: 100}, limit=1000)
    assert positions(cell) == [5000, 500, 5]


def test_a_line_of_several_axes_is_straight_to_less_than_a_step_of_each_pulse_by_pulse() -> None:
    for distances in ((1000, 700, -333), (500, 17, 0), (-300, 299, 298), (64, -64, 32)):
        cell, ccu = robot(switches=False)
        ccu.move_line(dict(enumerate(distances, 1)))
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


def test_a_port_gives_up_on_a_drive_that_is_not_there() -> None:
    cell, ccu = robot()
    with pytest.raises(DriveFailed, match="drive 9 does not answer"):
        ccu.status(9)
    assert ccu.status(1) == Report(0, 0)
    assert cell.now < 3 * 10**9
