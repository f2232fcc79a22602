"""Every wrong wiring is one line with file, key and remedy, before anything moves: from `boards check`, and `serve`."""

import io
from collections.abc import Callable
from pathlib import Path

import pytest

from detent.cell.description import Problem
from detent.cli import main
from detent.realtime.boards import drive
from detent.realtime.boards.fake.board import FakeBoard
from detent.realtime.boards.fake.chips import Chip, Chips
from detent.realtime.boards.fake.port import FakePort
from detent.realtime.boards.opening import NotYet
from detent.realtime.boards.ports import open_port
from detent.realtime.service import Service

CELL = """
[units.x]
model = "gs-c200"
[boards.b]
serial = "fake:"
[hardware.x]
board = "b"
step = "!gpio2"
dir = "gpio3"
outputs = { MOV = "gpio6" }
inputs = { EOT = "^gpio10", HOME = "^gpio11" }
driver = { kind = "tmc2209", uart = "gpio20", address = 1, amperes = 0.8, microsteps = 2 }
"""

Change = tuple[str, str]
SAME: Change = ("", "")


def no_answer(_: FakeBoard) -> FakePort:
    return FakePort(FakeBoard(moves=400), spoil=lambda data, to_board: [])


def old(*commands: str) -> Callable[[FakeBoard], FakePort]:
    return lambda _: FakePort(FakeBoard(moves=400, leave_out=commands))


def deaf(board: FakeBoard) -> FakePort:
    board.chips = Chips({"gpio20": [Chip(1, deaf=True)]})
    return FakePort(board)


def aliased(_: FakeBoard) -> FakePort:
    """Each pin has two names, as in the firmware's Linux process."""
    return FakePort(FakeBoard(moves=400, pins={"chip0/gpio0": (0, 64), "gpio0": (0, 64)}))


def unfit(*pins: str) -> Callable[[FakeBoard], FakePort]:
    """Pins that the board has, and that cannot do what they are for: only the firmware knows."""

    def port(_: FakeBoard) -> FakePort:
        board = FakeBoard(moves=400, unfit=pins)
        board.chips = Chips()
        return FakePort(board)

    return port


CASES: dict[str, tuple[Change, Callable[[FakeBoard], FakePort], str, str]] = {
    # what is wrong: what is different in the cell file, or on the board; the key; what the line says
    "no board": (("fake:", "/dev/serial/by-id/usb-Klipper_x"), FakePort, "boards.b.serial",
                 "cannot be opened: No such file or directory; look at /dev/serial/by-id and plug it in"),
    "no serial device": (("fake:", "/dev/null"), FakePort, "boards.b.serial", "is no serial device"),
    "a directory": (("fake:", "/dev"), FakePort, "boards.b.serial",
                    "/dev is a directory: name the board's device in it"),
    "another device": (SAME, no_answer, "boards.b.serial", "it does not answer"),
    "a firmware too old for stops": (SAME, old("trsync_start", "stepper_stop_on_trigger"), "boards.b.serial",
                                     "stepper_stop_on_trigger, trsync_start"),
    "a firmware too old for a chip": (SAME, old("config_tmcuart", "tmcuart_send"), "boards.b.serial", "config_tmcuart"),
    "a pin that the board has not": (("gpio6", "gpio99"), FakePort, "hardware.x.outputs.MOV", "gpio99"),
    "a pin that the board needs itself": (("gpio6", "gpio1"), FakePort, "hardware.x.outputs.MOV", "gpio1"),
    "an output on a pin that is none": (SAME, unfit("gpio6"), "hardware.x.outputs.MOV: the firmware does not take",
                                        "take another pin"),
    "an input on a pin that is none": (SAME, unfit("gpio11"), "hardware.x.inputs.HOME: the firmware does not take",
                                       "take another pin"),
    "steps on a pin that is none": (SAME, unfit("gpio2"), "hardware.x: the firmware does not take gpio2 and gpio3",
                                    "take another pin"),
    "a chip on a pin that is none": (SAME, unfit("gpio20"), "hardware.x.driver.uart: the firmware does not take gpio20",
                                     "take another pin"),
    "a pin used twice": (("gpio6", "gpio10"), FakePort, "hardware.x.inputs.EOT",
                         "pin gpio10 of b is hardware.x.outputs.MOV already: take another"),
    "a pin used under two names": (("gpio6", "chip0/gpio3"), aliased, "hardware.x.outputs.MOV",
                                   "chip0/gpio3 is the pin gpio3, which is taken by x.dir; use another"),
    "a pin that the board needs, by its other name": (("gpio6", "chip0/gpio1"), aliased, "hardware.x.outputs.MOV",
                                                      "the board needs chip0/gpio1 itself"),
    "what is no pin": (("^gpio10", "^^gpio10"), FakePort, "hardware.x.inputs.EOT", "write a pin of a board like gpio7"),
    "a driver that does not answer": (SAME, deaf, "hardware.x.driver",
                                      "the tmc2209 at gpio20, address 1 does not answer; look at its supply"),
    "a driver without its current": (("amperes = 0.8, ", ""), FakePort, "hardware.x.driver.amperes", "amperes = 0.8"),
    "a driver that gives too little": (("amperes = 0.8", "amperes = 1.9"), FakePort, "hardware.x.driver.sense",
                                       "take a smaller resistor"),
    "a driver without its microsteps": ((", microsteps = 2", ""), FakePort, "hardware.x.driver.microsteps",
                                        "microsteps = 2 for half steps"),
    "an axis without its stop pins": (('EOT = "^gpio10", ', ""), FakePort, "hardware.x.inputs",
                                      "x has no EOT: wire it, inputs = { EOT = 'PIN' }, or say that the machine has "
                                      "none, unwired = ['EOT']"),
    "an input wired twice": (("[boards.b]", '[switches.end]\ndrives = "x.EOT"\nat = 5\naxis = "x"\n[boards.b]'),
                             FakePort, "hardware.x.inputs.EOT",
                             "x.EOT is on a wire from end in this cell already: remove one"),
    "an output that the unit has not": (("MOV =", "MOVE ="), FakePort, "hardware.x.outputs.MOVE", "did you mean MOV?"),
    "an input that the unit has not": (("HOME =", "HOM ="), FakePort, "hardware.x.inputs.HOM", "did you mean HOME?"),
    "a board that the file has not": (('board = "b"', 'board = "c"'), FakePort, "hardware.x.board", "'c'"),
    "an axis without a direction": (('dir = "gpio3"\n', ""), FakePort, "hardware.x.dir", "this key is missing"),
    "a lead too short": (('"fake:"', '"fake:"\nlead = "1 ms"'), FakePort, "boards.b.lead", "30 ms do on"),
}  # fmt: skip


MAY_PASS = {"no board", "a directory", "no serial device", "another device", "a driver that does not answer"}


@pytest.mark.parametrize("verb", ["boards check", "serve"])
@pytest.mark.parametrize("case", CASES, ids=[name.replace(" ", "-") for name in CASES])
def test_it_is_one_line_with_file_key_and_remedy(
    case: str, verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert Service  # it is there before its clock and its ports are others
    change, port, key, text = CASES[case]
    assert change[0] in CELL
    fake = FakeBoard(moves=400)
    fake.chips = Chips()
    begin = 1_000_000_000
    now = [begin]

    def wall() -> int:
        return now[0]

    def sleep(_: object, __: object, seconds: float) -> tuple[tuple[int, ...], tuple[int, ...]]:
        now[0] += max(round(seconds * 1e9), 10_000)
        return (), ()

    def opened(address: str) -> object:
        return port(fake) if address == "fake:" else open_port(address)

    real = drive.RealPins

    def pretended(tell: Callable[..., None]) -> object:
        return real(tell, opened, wall, sleep)  # type: ignore[arg-type]

    monkeypatch.setattr(drive, "RealPins", pretended)
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    cell = tmp_path / "cell.toml"
    cell.write_text(CELL.replace(*change))
    words = ["boards", "check", str(cell), "--yes"] if verb == "boards check" else [
        "serve", str(cell), "--real", "--tcp", "127.0.0.1:0", "--state", str(tmp_path / "state"),
    ]  # fmt: skip
    kinds: list[type[Problem]] = []
    made = Problem.__init__

    def noted(problem: Problem, *given: str) -> None:
        kinds.append(type(problem))
        made(problem, *given)

    monkeypatch.setattr(Problem, "__init__", noted)
    with pytest.raises(SystemExit) as end:
        main(words)
    assert (kinds[-1] is NotYet) is (case in MAY_PASS), "whether a service waits for it"
    told = capsys.readouterr()
    assert (end.value.code, told.out) == (2, ""), told.err
    assert told.err.startswith(f"detent: {cell}: {key}"), told.err
    assert text in told.err
    assert told.err.count("\n") == 1
    assert fake.machine.steps == []
