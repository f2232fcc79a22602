"""PWM counts of windings in waveforms and arrays, against `outputs.windings.duties`, which asks one time by one."""

import json
import zipfile

import numpy as np
import pytest
from tests.controllers.genstepper.boards import READY, Board
from tests.outputs.test_vcd import parse, signed

from detent.controllers.device import DriveSet
from detent.outputs import arrays, figures, sigrok, vcd
from detent.outputs.signals import Signals, of_cell
from detent.outputs.windings import duties
from detent.ticks import MS, SECOND

ENDS = ("WA1", "WA2", "WB1", "WB2")
MOMENTS = {
    "microsteps, full power, off when idle": ["X320GY-77GB"],
    "single winding, left on": ["B0O1WX100GY-33GB"],
    "half steps, left at half power": ["B1O2WX100GY-33GB"],
    "full steps, half power, idle at a quarter": ["B2O1H2WX100GY-33GB"],
    "microsteps to the auto full step rate and back": ["B1W512A20000P2000RX900GY-900GB"],
    "rates, modes and power changed in motion": [
        "B1WX62500K512A+SY-S",
        "X3000R",
        "2OX100R",
        "1HY900R",
        "XZYZ3=",
        "-7G",
    ],
    "there and back without a rest": ["B900K512A2000RX60GY-90G", "X-60GY30G", "X+SY-S", "X-S", "Z"],
    "a microstep of three": ["3!", "", "B3O1W", "X100GY-33G"],
    "pulses in E mode": ["1WE1W1E"],
}


def played(lines: list[str], board: Board | None = None) -> tuple[Board, Signals]:
    board = Board() if board is None else board
    for line in lines:
        board.say(line, 300 * MS)
    if lines[-1].endswith("1E"):
        for _ in range(20):
            for pin, level in (("X+", 0), ("Y-", 0), ("X+", 1), ("Y-", 1)):
                board.pin(pin, level)
                board.run(20_000)
    board.run(SECOND)
    return board, of_cell(board.cell)


def wanted(board: Board, connector: str) -> list[tuple[int, tuple[int, ...]]]:
    """(time, counts) wherever they change, by `duties` at every step, every setting, every beginning of a motion."""
    axis = board.drives(connector)[0].axis
    asked = {-1, *(told.at for told in board.drives(connector) + board.motions(axis))}
    asked |= {at for at, _ in board.pulses(axis)}
    found: list[tuple[int, tuple[int, ...]]] = []
    times = sorted(asked)
    for at, counts in zip(times, duties(board.cell.recording, "board", connector, times), strict=True):
        if not found or found[-1][1] != tuple(counts):
            found.append((at, tuple(counts)))
    return found


def column(rows: list[tuple[int, tuple[int, ...]]], place: int) -> list[tuple[int, int]]:
    found: list[tuple[int, int]] = []
    for at, counts in rows:
        if not found or found[-1][1] != counts[place]:
            found.append((at, counts[place]))
    return found


@pytest.mark.parametrize("lines", MOMENTS.values(), ids=MOMENTS)
def test_every_winding_end_of_a_vcd_has_the_counts_of_each_step_and_setting(lines):
    board, seen = played(lines)
    found, _ = parse(b"".join(vcd.pieces(seen)).decode("ascii"))
    for axis in "XY":
        rows = wanted(board, axis)
        assert len(rows) >= 5
        for place, end in enumerate(ENDS):
            got = [(at, int(bits, 2)) for at, bits in found["board", axis + end]]
            assert got == column(rows, place), axis + end


def test_windows_of_any_size_give_the_same_bytes(monkeypatch):
    _, seen = played(MOMENTS["rates, modes and power changed in motion"])
    whole = b"".join(vcd.pieces(seen))
    windows = Signals.windows
    monkeypatch.setattr(Signals, "windows", lambda self: windows(self, 7))
    assert b"".join(vcd.pieces(seen)) == whole


def test_the_modes_look_as_they_should():
    counts = {}
    for mode in range(4):
        board, seen = played([f"X{mode}O1W", "X64G"])
        found, _ = parse(b"".join(vcd.pieces(seen)).decode("ascii"))
        moved = [int(bits, 2) for at, bits in found["board", "XWA1"] if at > READY + 300 * MS]
        counts[mode] = moved
        assert len(board.pulses()) == 64
    assert counts[0] == counts[1] == counts[2] == [0, 256], "switched on and off once in an electrical cycle"
    assert len(counts[3]) == 32, "a value for each microstep of the two quarters in which it carries current"


def test_a_header_says_how_many_counts_are_a_period():
    _, seen = played(["X10G"])
    header = next(iter(vcd.pieces(seen))).decode()
    assert "256 counts a period" in header
    assert "$var wire 9 " in header


def test_without_supply_there_are_no_counts():
    board = Board()
    board.say("B1W")
    board.cell.power("board", on=False)
    board.run(MS)
    end = board.cell.now
    found, _ = parse(b"".join(vcd.pieces(of_cell(board.cell))).decode("ascii"))
    assert [int(bits, 2) for _, bits in found["board", "YWA1"]] == [0, 256, 0]
    assert duties(board.cell.recording, "board", "Y", [0, end]) == [(0, 0, 0, 0), (0, 0, 0, 0)]


def test_double_current_gives_both_connectors_the_counts_of_x():
    board, seen = played(["B1WX100GY-33G"], Board(double_current="yes"))
    found, _ = parse(b"".join(vcd.pieces(seen)).decode("ascii"))
    for end in ENDS:
        assert found["board", "X" + end] == found["board", "Y" + end]
    assert wanted(board, "X") == wanted(board, "Y")


def test_a_winding_with_a_wire_has_its_counts_too():
    toml = '[[wires]]\nfrom = "board.YWA1"\nto = "other.NXT"\n[units.other]\nmodel = "bs0710"\n'
    board, seen = played(["B1WX100GY-33G"], Board(toml=toml))
    found, _ = parse(b"".join(vcd.pieces(seen)).decode("ascii"))
    counts = [(at, int(bits, 2)) for at, bits in found["board", "YWA1"]]
    assert counts == column(wanted(board, "Y"), 0)
    assert [(at, int(level)) for at, level in found["other", "NXT"]][1:] != []


def test_arrays_hold_both_axes_and_all_windings(tmp_path):
    board, seen = played(MOMENTS["microsteps to the auto full step rate and back"])
    arrays.write(tmp_path / "a.npz", seen)
    with np.load(tmp_path / "a.npz") as kept:
        for name, axis in (("board", "X"), ("board.Y", "Y")):
            assert kept[f"{name}/step_times"].tolist() == [at for at, _ in board.pulses(axis)]
            assert kept[f"{name}/step_directions"].tolist() == [way for _, way in board.pulses(axis)]
            for place, end in enumerate(ENDS):
                times, counts = kept[f"board/{axis}{end}/times"], kept[f"board/{axis}{end}/counts"]
                assert (times.dtype, counts.dtype) == (np.int64, np.int16)
                assert list(zip(times.tolist(), counts.tolist(), strict=True)) == column(wanted(board, axis), place)
        assert "board/RDY/levels" in kept
        assert json.loads(str(kept["meta"]))["units"]["board"]["windings"] == [a + e for a in "XY" for e in ENDS]


def test_sigrok_has_the_windings_of_both_axes_as_levels(tmp_path):
    board, seen = played(["B1O1WX100GY-33GB"])
    names = [f"board.{axis}{end}" for axis in "XY" for end in ENDS]
    assert set(names) <= {channel.name for channel in sigrok.channels(seen)}
    sigrok.write(tmp_path / "a.sr", seen, names=names, samplerate=SECOND // 16_000)  # a sample a tick
    with zipfile.ZipFile(tmp_path / "a.sr") as archive:
        chunks = sorted((n for n in archive.namelist() if n.startswith("logic")), key=lambda n: int(n.split("-")[-1]))
        samples = np.frombuffer(b"".join(archive.read(name) for name in chunks), np.uint8)
    for bit, name in enumerate(names):
        axis, place = name[6], ENDS.index(name[7:])
        edges = [(at, int(count > 0)) for at, count in column(wanted(board, axis), place)]
        levels = samples >> bit & 1
        places = (np.flatnonzero(np.diff(levels)) + 1).tolist()
        assert places == [-(-at // 16_000) for at, _ in edges[1:]]
        assert levels[places].tolist() == [level for _, level in edges[1:]]


def test_a_figure_has_a_strip_for_the_power_of_each_motor():
    board, seen = played(["B2WX320G", "1HX0G"])
    strips = {lane.label: lane for lane in figures.chosen_lanes(seen) if isinstance(lane, figures.Strip)}
    assert list(strips) == ["board.X power", "board.Y power"]
    assert [band.label for band in strips["board.X power"].bands] == ["full", "half", "quarter"]
    assert [band.label for band in strips["board.Y power"].bands] == ["half", "quarter"]
    assert strips["board.Y power"].bands[-1].end == board.cell.now


def test_positions_of_the_second_axis_are_in_the_vcd():
    board, seen = played(["X30GY-20G"])
    found, _ = parse(b"".join(vcd.pieces(seen)).decode("ascii"))
    assert [signed(bits) for _, bits in found["board.Y", "position"]] == list(range(0, -21, -1))
    assert [at for at, _ in found["board.Y", "position"]][1:] == [at for at, _ in board.pulses("Y")]


def test_a_million_microsteps_take_no_event_and_no_setting_each():
    board = Board()
    board.say("0AX62500K62500R1000000G", 17 * SECOND)
    assert len(board.entries(DriveSet)) < 10
    seen = of_cell(board.cell)
    driven = seen.unit("board").windings["XWA1"]
    assert sum(len(driven.wave("XWA1", *window)[0]) for window in seen.windows()) > 30_000
