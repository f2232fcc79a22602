"""A motor in a cell follows what its controller commands of the power stage, while it moves and at rest."""

from math import hypot

import numpy as np
import pytest

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.mechanics import Mechanics
from detent.motors import kernel
from detent.motors.drive import FAST, SLOW, VOLTAGE
from detent.ticks import MS, SECOND, US, Ns

CELL = """
[units.axis]
model = "{model}"
[motors.slide]
motor = "qsh4218-41-10-035"
unit = "axis"
axis = "{axis}"
supply = {supply}
load = {{ inertia = 5.4e-6, friction = 0.01, viscous = 1e-3 }}
"""
BOOT = 2 * SECOND
FULL_POWER = 8 / 4.5  # A: the supply through the winding (BS0610 manual, page 64)


def cell(model: str, axis: str = "", supply: float = 24, more: str = "") -> Cell:
    text = CELL.format(model=model, axis=axis, supply=supply) + more
    made = build(parse(text, "cell.toml"), lambda _: "", record=False, line_timing=False)
    made.run_to(BOOT)
    return made


def board(more: str = "") -> Cell:
    return cell("bs0610", "X", 8, more)


def dcb(more: str = "") -> Cell:
    made = cell("dcb-274", more=more)
    made.send(0, b" ")
    return made


def motor(of: Cell) -> Mechanics:
    part = of.parts[of.wiring.names.index("slide")]
    assert isinstance(part, Mechanics)
    return part


def tell(of: Cell, *commands: str, wait: Ns = 50 * MS) -> Cell:
    """Give commands; a while passes after each."""
    for command in commands:
        of.type("axis", command)
        of.run_to(of.now + wait)
    return of


def currents(of: Cell) -> tuple[float, float]:
    s = motor(of).rotor_at(of.now).s
    return float(s[kernel.IA]), float(s[kernel.IB])


def state(of: Cell, column: int) -> int:
    return int(motor(of).rotor_at(of.now).n[column])


class TestGenStepper:
    def test_w_commands_what_an_idle_motor_gets(self) -> None:
        made = board()
        for w, part in ((0, 0), (1, 1), (2, 0.5)):
            tell(made, f"X{w}W", wait=300 * MS)
            assert hypot(*currents(made)) == pytest.approx(part * FULL_POWER, abs=1e-3)

    def test_h_halves_the_power(self) -> None:
        made = tell(board(), "1W", "1H", wait=300 * MS)
        assert hypot(*currents(made)) == pytest.approx(FULL_POWER / 2, abs=1e-3)

    def test_o_commands_the_sequence_also_while_the_motor_moves(self) -> None:
        made = tell(board(), "400R", "4000G")
        for o in (0, 1, 2, 3):
            tell(made, f"X{o}O")
            assert state(made, kernel.ROW) == o
            assert state(made, kernel.MODE) == VOLTAGE
        tell(made, "Z", "1W", "2O", wait=2 * SECOND)
        assert [abs(i) for i in currents(made)] == pytest.approx([FULL_POWER] * 2, abs=1e-3)  # both windings on

    def test_a_commands_full_steps_while_the_rate_is_above_its_value(self) -> None:
        """Pages 28 and 29: in the ramp the sequence changes by itself, and back on the way down."""
        made = tell(board(), "1H", "1024A", "3000R", "6000G", wait=0)
        seen = []
        while len(seen) < 3 and made.now < BOOT + 20 * SECOND:
            made.run_to(made.now + 10 * MS)
            n = motor(made).rotor_at(made.now)
            what = int(n.n[kernel.ROW]), float(n.s[kernel.LEVEL])
            if not seen or seen[-1] != what:
                seen.append(what)
        assert seen == [(3, 0.5), (2, 1.0), (3, 0.5)]

    def test_the_rotor_goes_where_the_board_counts(self) -> None:
        made = tell(board(), "1W", "X400G", wait=3 * SECOND)
        assert motor(made).place(made.now) == pytest.approx(400, abs=1)  # sixteenths, as it counts
        tell(made, "X-50G", wait=4 * SECOND)
        assert motor(made).place(made.now) == pytest.approx(-50, abs=1)


class TestDcb274:
    def test_run_current_while_moving_and_hold_current_a_second_behind(self) -> None:
        """Page 52: 100 is 4 A a phase; "a settling time (nominally 1 second) is inserted"."""
        made = tell(dcb(), "Y 10 20", wait=SECOND)
        assert hypot(*currents(made)) == pytest.approx(0.4, abs=1e-3)
        tell(made, "+400", wait=500 * MS)
        assert hypot(*currents(made)) == pytest.approx(0.8, abs=1e-3)
        made.run_to(made.now + SECOND)
        assert hypot(*currents(made)) == pytest.approx(0.4, abs=1e-3)

    def test_y_counts_at_once_in_motion(self) -> None:
        made = tell(dcb(), "M 500", "Y 10 20", wait=SECOND)
        before = hypot(*currents(made))
        tell(made, "Y 10 40", wait=200 * MS)
        assert hypot(*currents(made)) == pytest.approx(2 * before, rel=0.1)

    def test_the_decay_is_that_of_the_controller_at_every_moment(self) -> None:
        """Page 36: slow at rest and below the threshold, fast above."""
        made, seen = tell(dcb(), "b 30", "I 400", "V 6000", "+3000", wait=0), set()
        for _ in range(300):
            made.run_to(made.now + 7 * MS)
            slow = made.controller("axis").drive(made.now).slow_decay  # type: ignore[attr-defined]
            assert state(made, kernel.MODE) == (SLOW if slow else FAST)
            seen.add(slow)
        assert seen == {False, True}

    @pytest.mark.parametrize(("b", "moving"), [(0, FAST), (255, SLOW)])
    def test_b_0_is_fast_in_motion_and_255_always_slow(self, b: int, moving: int) -> None:
        made = tell(dcb(), f"b {b}", "M 2000")
        assert state(made, kernel.MODE) == moving
        tell(made, "M 0", wait=SECOND)
        assert state(made, kernel.MODE) == SLOW

    def test_h_changes_how_far_a_step_goes(self) -> None:
        """Page 40: quarter steps at first; a full step is four of them."""
        made = tell(dcb(), "+48", wait=SECOND)
        assert motor(made).place(made.now) == pytest.approx(48, abs=0.5)
        tell(made, "H 3", "I 100", "V 200", "+10", wait=SECOND)
        # the sequence began again, at both windings on: half a full step from where it was
        assert motor(made).place(made.now) == pytest.approx(48 + 2 + 10 * 4, abs=0.5)

    def test_a_motor_without_hold_current_is_loose(self) -> None:
        made = tell(dcb(), "Y 0 50", "+40", wait=3 * SECOND)
        assert currents(made) == pytest.approx((0, 0), abs=1e-3)

    def test_pre_energize_gives_the_run_current_before_the_first_step(self) -> None:
        """w: page 51."""
        made = tell(dcb(), "Y 10 20", "w 20", "+4", wait=100 * MS)
        assert made.controller("axis").status(made.now).pulses == 0
        assert hypot(*currents(made)) == pytest.approx(0.8, abs=1e-3)


class TestTime:
    COMMANDS = (
        ("bs0610", ("1H", "1024A", "3000R", "3000G", "1O", "=", "Z")),
        ("dcb-274", ("Y 5 30", "+900", "b 60", "@", "H 2", "+50", "Y 10 60")),
    )

    @staticmethod
    def made(model: str) -> Cell:
        switch = '[switches.there]\naxis = "{}"\nfrom = 25.5\ndrives = "axis.{}"\n'
        return board(switch.format("slide", "LX+")) if model == "bs0610" else dcb(switch.format("slide", "HOME"))

    @pytest.mark.parametrize(("model", "commands"), COMMANDS)
    @pytest.mark.parametrize("slice_", [333 * US, 3 * MS + 1])
    def test_slices_of_time_and_copies_change_nothing(self, model: str, commands: tuple[str, ...], slice_: Ns) -> None:
        whole = self.made(model)
        sliced = whole.copy()
        for command in commands:
            for one in (whole, sliced):
                one.type("axis", command)
            until = whole.now + 60 * MS
            whole.run_to(until)
            while sliced.now < until:
                sliced.run_to(min(sliced.now + slice_, until))
                motor(sliced).place(sliced.now)  # asking changes nothing
            sliced = sliced.copy()
            a, b = (motor(one).rotor_at(until) for one in (whole, sliced))
            assert np.array_equal(a.s, b.s)
            assert np.array_equal(a.n, b.n)
