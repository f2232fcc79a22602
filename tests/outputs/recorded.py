"""Recordings made by hand: two units, a drilling cell in small."""

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.recording import InputSet, Received, Recording
from detent.controllers.device import Powered
from detent.outputs.units import UnitView
from detent.pins import LOW, Pin, PinKind, PinSet, PulseOutput
from detent.ramps.constant_acceleration import move
from detent.ticks import MS, SECOND, to_fixed
from detent.uart import Char, Format, Sent

FORM = Format(9600, 7, "odd", 2)
CLOCK = PulseOutput({1: "CLOCK", -1: "CLOCK"}, 1_700, LOW)
PINS = (
    Pin("RXD", 1, PinKind.SERIAL, "received data"),
    Pin("TXD", 2, PinKind.SERIAL, "transmitted data"),
    Pin("RDY", 3, PinKind.OPEN_COLLECTOR, "0 while a command or a program is in execution"),
    Pin("CLOCK", 4, PinKind.OUTPUT, "step clock"),
    Pin("DIR", 5, PinKind.OUTPUT, "direction"),
    Pin("MOV", 6, PinKind.OUTPUT, "1 while a movement is in execution", 0),
    Pin("UO1", 7, PinKind.OUTPUT, "user output 1", 0),
    Pin("UI1", 8, PinKind.INPUT, "user input 1"),
    Pin("VS", 9, PinKind.SUPPLY, "supply"),
)
BAR = UnitView("bar", PINS, CLOCK, FORM)
DRILL = UnitView("drill", PINS, CLOCK, FORM)


def said(text: str, at: int, port: str = "TXD") -> list[Sent]:
    """Characters sent back to back from `at` on."""
    return [
        Sent(at + FORM.duration(i), port, Char(ord(letter)), at + FORM.duration(i + 1)) for i, letter in enumerate(text)
    ]


def heard(text: str, at: int) -> list[Received]:
    """Characters of the host, the first start bit at `at`."""
    return [Received(sent.done, "RXD", sent.char, sent.at) for sent in said(text, at)]


def moved(steps: int, direction: int, at: int, shaft: int = 0, speeds: tuple[int, int, int] = (100, 2000, 50)):
    """A whole move, as an axis tells it."""
    train = move(*speeds, steps).train.at(to_fixed(at))
    end = train.time_of(steps)
    return [MotionStarted(at, train, 1, direction, shaft), MotionEnded(end, steps)], end


def drilling() -> tuple[Recording, int]:
    """Power, a command and its answer, a move of the bar, an edge to the drill, its move down and back."""
    recording = Recording(["bar", "drill"])
    recording.extend(0, [Powered(0, True), PinSet(0, "CLOCK", 1)])
    recording.extend(1, [Powered(0, True), PinSet(0, "CLOCK", 1)])
    recording.extend(0, heard("+300\r", 1 * MS))
    recording.extend(0, [PinSet(7 * MS, "RDY", 0), *said("Y\r", 7 * MS)])
    motion, end = moved(300, 1, 8 * MS)
    recording.extend(0, [PinSet(8 * MS, "DIR", 1), PinSet(8 * MS, "MOV", 1), motion[0]])
    recording.extend(0, [motion[1], PinSet(end, "MOV", 0), PinSet(end, "UO1", 1)])
    recording.extend(1, [InputSet(end, "UI1", 0)])
    at = end + 2 * MS
    down, end = moved(150, 1, at)
    recording.extend(1, [PinSet(at, "MOV", 1), *down, PinSet(end, "MOV", 0)])
    at = end + 50 * MS
    up, end = moved(150, -1, at, 150)
    recording.extend(1, [PinSet(at, "DIR", 0), PinSet(at, "MOV", 1), *up, PinSet(end, "MOV", 0)])
    recording.extend(0, [PinSet(end, "RDY", 1)])
    return recording, end + 10 * MS


def interrupted() -> tuple[Recording, int]:
    """A move of the drill that is cut, one that changes its mind, and one in which the supply fails."""
    recording = Recording(["drill"])
    recording.extend(0, [Powered(5, True)])
    first, _ = moved(500, 1, 1 * MS)
    train = first[0].train
    recording.extend(0, [first[0], MotionCut(train.time_of(40) + 9, 40)])
    begin = SECOND
    second, _ = moved(1000, -1, begin, 40)
    given = second[0].train.steps_by(begin + 100 * MS)
    shorter, end = moved(600, -1, begin, 40)
    recording.extend(0, [second[0], MotionStarted(begin + 100 * MS, shorter[0].train, given + 1, -1, 40)])
    recording.extend(0, [MotionEnded(end, 600)])
    third, _ = moved(100, 1, 2 * SECOND, -560)
    off = third[0].train.time_of(30) + 800  # within the pulse
    recording.extend(0, [third[0], MotionCut(off, 30), Powered(off, False), Powered(off + 5_000, True)])
    recording.extend(0, [PinSet(off + 5_000, "CLOCK", 1)])
    return recording, off + 10 * MS
