"""Every cell of `examples/`, run, with what its comments promise."""

import runpy
from itertools import pairwise
from pathlib import Path

import pytest

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.host import HostPort
from detent.hosts.supersigma import BlockingCcu, Ccu
from detent.outputs.signals import UnitSignals, of_cell
from detent.ticks import MS, SECOND, Ns

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name: str, **replaced: str) -> Cell:
    """The cell of an example; `replaced` are texts put in place of others (`old=new`), for a comparison."""
    folder = EXAMPLES / name
    text = (folder / "cell.toml").read_text()
    for old, new in replaced.items():
        assert old in text
        text = text.replace(old, new)
    return build(parse(text, f"{name}/cell.toml"), lambda file: (folder / file).read_text())


def run(cell: Cell) -> Cell:
    """The cell when nothing is left to do."""
    while cell.step() is not None:
        pass
    return cell


def seen(cell: Cell, unit: str) -> UnitSignals:
    return of_cell(cell).unit(unit)


def positions(cell: Cell) -> dict[str, int]:
    return {name: unit.status(cell.now).position for name, unit in cell.controllers().items()}


def pulses(cell: Cell, unit: str) -> list[Ns]:
    """The times of all pulses of a unit."""
    return seen(cell, unit).motion.pulses(0, cell.now + 1).times.tolist()


def test_no_example_is_without_a_test() -> None:
    tested = {
        "assembly", "closed-loop", "closed-loop-motor", "damping", "drilling", "genstepper", "homing",
        "menu", "multipoint", "synchronised", "velocity", "xyz-party-line",
    }  # fmt: skip
    assert {path.parent.name for path in EXAMPLES.glob("*/cell.toml")} == tested


def test_drilling_serves_five_holes_and_cuts() -> None:
    cell = run(example("drilling"))
    assert positions(cell) == {"bar": 980, "drill": 0}  # 250 + 4 * 120 + 250
    assert len(pulses(cell, "drill")) == 5 * 2 * 150


class TestClosedLoop:
    def test_a_motor_that_hesitates_stretches_the_move_and_loses_no_pulse(self) -> None:
        healthy = pulses(run(example("closed-loop", **{"slow_to = 420": "slow_to = 0"})), "axis")
        hesitant = pulses(run(example("closed-loop")), "axis")
        assert len(healthy) == len(hesitant) == 1000
        assert hesitant[:401] == healthy[:401]
        assert {after - before for before, after in pairwise(hesitant[400:421])} == {5 * MS}
        # behind the hesitation the old intervals: 20 steps took 5 ms instead of 1 ms
        assert [t - 20 * 4 * MS for t in hesitant[421:]] == pytest.approx(healthy[421:], abs=1)  # rounded anew

    def test_a_healthy_motor_changes_nothing(self) -> None:
        open_loop = example("closed-loop", **{'to = "axis.ENABLE"': 'to = "axis.UI3"'})
        closed = example("closed-loop", **{"slow_to = 420": "slow_to = 0"})
        assert pulses(run(closed), "axis") == pulses(run(open_loop), "axis")


def test_modules_on_one_enable_line_stop_and_go_on_together() -> None:
    cell = run(example("synchronised"))
    assert positions(cell) == {"x": 1000, "y": 400}
    free = run(example("synchronised", **{"set = { go = 0 }": "set = { go = 1 }"}))
    for unit in ("x", "y"):
        times, without = pulses(cell, unit), pulses(free, unit)
        held = next(n for n, t in enumerate(times) if t >= 400 * MS)
        assert times[:held] == without[:held]
        assert times[held] == 900 * MS  # the pulse that fell due meanwhile, at the moment ENABLE rises
        late = 900 * MS - without[held]
        assert [t - late for t in times[held:]] == pytest.approx(without[held:], abs=1)  # rounded anew


def test_seven_modules_on_one_line_each_obey_their_own_commands() -> None:
    cell = run(example("multipoint"))
    assert positions(cell) == {f"u{n}": 100 * n for n in range(1, 8)}
    heard = bytes(h.char.value for h in cell.lines[0].take())
    assert cell.controller("u1").answers(heard) == ["Y"] * 7


def test_a_module_without_host_homes_and_runs_its_stored_program() -> None:
    cell = run(example("homing"))
    assert positions(cell) == {"slide": 0}
    slide = seen(cell, "slide")
    up, back = 300 - 120, 300
    homed = pulses(cell, "slide")[up + back - 1]
    assert slide.motion.position(homed) == 0
    intervals = {b - a for a, b in pairwise(pulses(cell, "slide")[:up])}
    assert intervals == {SECOND // 200}  # S20, the first S of the program
    # G+2: 250 pulses until the sensor, one that keeps its time, then a ramp of 60; and the same way back
    assert len(pulses(cell, "slide")) == up + back + 2 * (250 + 1 + 60)
    assert slide.motion.position(pulses(cell, "slide")[up + back + 311 - 1]) == 311


def test_buttons_choose_what_is_executed() -> None:
    cell = example("menu")
    cell.run_to(2 * SECOND)
    assert positions(cell) == {"table": 800}
    cell.run_to(6 * SECOND)
    assert positions(cell) == {"table": 200}
    reached = seen(cell, "table").wave("UO1")
    assert reached.levels.tolist()[-4:] == [1, 0, 1, 0]
    assert cell.controller("table").status(cell.now).state == "running"  # the menu waits for the next button


def test_the_belt_stops_one_ramp_behind_each_mark() -> None:
    cell = run(example("velocity"))
    belt = seen(cell, "belt")
    for mark in (1.0, 2.5, 4.0):
        at = round(mark * SECOND)
        stopped = belt.motion.position(at + 150 * MS)
        assert stopped == belt.motion.position(at + 200 * MS)
        assert stopped - belt.motion.position(at) == 1 + 40  # the pulse that keeps its time, and R
    assert positions(cell) == {"belt": belt.motion.position(cell.now)}


def test_the_sin_10_moves_three_axes_by_one_line_and_reads_where_they_are() -> None:
    cell = run(example("xyz-party-line"))
    assert positions(cell) == {"x": 1000, "y": 1000, "z": 1000}
    heard = bytes(h.char.value for h in cell.lines[0].take()).decode().split("\r\n")
    assert heard == ["XYZ", "X+1000", "Y+1000", "Z+1000", "9W*", "XZ     1000", "YZ     1000", "ZZ     1000", ""]


@pytest.fixture(scope="module")
def assembled() -> Cell:
    """The cell of the seven drives behind its whole program."""
    cell = example("assembly")
    port = HostPort(cell)
    script = runpy.run_path(str(EXAMPLES / "assembly" / "pick_and_place.py"))
    script["pick_and_place"](BlockingCcu(Ccu(), port), port.wait)
    return cell


class TestAssembly:
    def test_the_seven_drives_of_the_robot_find_their_origins_and_come_home_again(self, assembled: Cell) -> None:
        assert len(positions(assembled)) == 7
        assert set(positions(assembled).values()) == {0}
        ccu = BlockingCcu(Ccu(), HostPort(assembled))
        assert all(ccu.status(drive).flags == 8 for drive in range(1, 8))  # originated, and nothing else

    def test_the_bearing_goes_on_a_straight_line_beside_which_no_axis_is_by_a_step(self, assembled: Cell) -> None:
        axes = [seen(assembled, f"left-{axis}") for axis in "xyz"]
        x, y, z = (axis.motion.pulses(0, assembled.now + 1) for axis in axes)
        origin = 1  # the half step at which the switches open
        begin = int(x.times[x.positions == origin + 6000 - 1][-1])  # the first pulse of the line, from 6000 to 5400
        end = int(x.times[x.positions == origin + 5400][-1])
        for axis, start, distance in ((y, 3750, 250), (z, 0, 200)):
            inside = (axis.times >= begin) & (axis.times <= end)
            for t, position in zip(axis.times[inside].tolist(), axis.positions[inside].tolist(), strict=True):
                gone = origin + 6000 - float(x.positions[x.times <= t][-1])
                slope = distance / 600
                assert abs(position - origin - start - gone * slope) < 1 + slope


def test_the_wait_of_the_page_comes_at_any_time() -> None:
    """docs/how-to/test-host-software.md waits for the drill at 150, in a cell that goes on with bar after bar."""
    page = (EXAMPLES.parent / "docs" / "how-to" / "test-host-software.md").read_text()
    assert "serve examples/drilling/bar-after-bar.toml --control" in page
    assert "wait --unit drill --position 150" in page
    folder = EXAMPLES / "drilling"
    text = (folder / "bar-after-bar.toml").read_text()
    cell = build(parse(text, "bar-after-bar.toml"), lambda file: (folder / file).read_text())
    cell.run_to(20 * SECOND)
    drill = pulses(cell, "drill")
    assert len(drill) > 10 * 600  # down and up, 300 steps each: it is at 150 twice a hole, to the end
    assert drill[-1] > 18 * SECOND
