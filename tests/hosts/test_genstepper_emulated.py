"""The driver of a GenStepper board on an emulated one, in virtual time, with the line's own timing."""

import pytest
from tests.hosts.modules import FaultyPort, cell

from detent.cell.cell import Cell
from detent.cell.host import HostPort
from detent.hosts.axis import Limits, Speeds
from detent.hosts.errors import MotionFailed, NoAnswer
from detent.hosts.genstepper import Action, BlockingGenStepper, GenStepper, Latches

VERBOSE = [(False, False), (True, False), (False, True), (True, True)]
LIMIT = """
[switches.end]
drives = "board.LX+"
axis = "board.X"
from = 1500
"""


def board(more: str = "") -> tuple[Cell, BlockingGenStepper, BlockingGenStepper]:
    made = cell(f'[units.board]\nmodel = "bs0610"\n{more}')
    port = HostPort(made)
    return made, BlockingGenStepper(GenStepper("X"), port), BlockingGenStepper(GenStepper("Y"), port)


@pytest.mark.parametrize(("first", "delayed"), VERBOSE)
def test_every_command_in_every_form_of_answers(first: bool, delayed: bool) -> None:
    made, x, y = board()
    assert x.version() == "2.18"
    assert x.latches() == Latches(frozenset(), reset=True)
    x.set_verbose(first=first, delayed=delayed)
    x.set_stop_rate(100)
    x.set_run_rate(2000)
    x.set_slope(10_000)
    x.set_auto_full_step(62_500)
    x.set_step_mode(1)
    x.set_idle_windings(1)
    x.set_half_power(True)
    x.set_limit_switches(blocked=["Y+"])
    told = x.reports()
    assert (told.stop_rate, told.run_rate, told.slope, told.step_mode, told.idle_windings) == (100, 2000, 10_000, 1, 1)
    assert x.memory(252) == 62_500 // 256
    x.go_to(400)
    assert x.action() is Action.RAMPING_UP
    y.go_to(-200)
    x.wait_idle(20)
    y.wait_idle(20)
    assert (x.position(), y.position()) == (400, -200)
    x.go_by(-100)
    x.wait(20)
    x.mark()
    x.set_position(0)
    x.go_by(5)
    x.wait(20)
    assert x.position() == 5
    x.go_to_mark()
    x.wait(20)
    assert x.position() == 300
    y.slew(-1)
    assert y.action() is Action.SLEWING
    assert x.action() is Action.IDLE
    x.stop_both()
    y.wait(20)
    x.go_both(7)
    x.wait(20)
    y.wait(20)
    assert (x.position(), y.position()) == (7, 7)
    y.slew(1)
    x.stop_both_at_once()
    assert not y.moving()
    x.set_direct(2, inverted=["X+"])
    x.set_direct(0)
    assert x.latches() == Latches(frozenset(), reset=False)
    assert x.reset(16) == "2.18"
    assert x.memory(253) == 16
    assert x.report(-10) == 800
    assert made.controller("board").status(made.now, "X").position == 0


def test_a_long_move_is_waited_for_however_long_it_takes() -> None:
    made, x, _ = board()
    x.set_speeds(Speeds(16, 16, 0))
    x.move_to(480)
    with pytest.raises(MotionFailed, match="still moves after 5 s"):
        x.wait(5)
    x.wait(600)
    assert x.position() == 480
    assert made.now > 30 * 10**9


def test_each_motor_has_its_own_exchanges_on_one_port() -> None:
    _, x, y = board()
    assert x.set_speeds(Speeds(100, 1000, 0.1)) == Speeds(100, 1000, 0.1)
    y.set_speeds(Speeds(80, 400, 0.1))
    x.move_to(1000)
    y.move_by(-300)
    assert x.position() > 0
    assert y.position() < 0
    x.move_by(500)  # from the target of the go that is under way
    x.wait(20)
    y.wait(20)
    assert (x.position(), y.position()) == (1500, -300)
    y.run_at(-2000)
    y.stop()
    y.wait(20)
    y.move_to(0)
    assert y.report(-10) == 400
    y.wait(20)
    x.run_at(62_500)
    x.halt()
    assert not x.moving()
    assert x.report(-11) == 100


def test_a_limit_ends_a_move_and_the_wait_says_which() -> None:
    _, x, _ = board(LIMIT)
    x.version()  # behind the sign-on
    x.latches()
    x.move_to(4000)
    with pytest.raises(MotionFailed, match=r"stands at 15\d\d and not at 4000; LX\+ is met"):
        x.wait(60)
    assert x.limits() == Limits(low=False, high=True)
    assert x.latches().limits == {"X+"}
    x.move_by(100)  # it does not even begin
    with pytest.raises(MotionFailed, match=r"LX\+ is met"):
        x.wait(60)
    x.slew(-1)
    x.stop()
    x.wait(60)
    x.set_position(0)
    assert x.position() == 0


def test_settings_come_back_and_another_step_size_takes_a_reset() -> None:
    _, x, y = board()
    x.set_speeds(Speeds(100, 1000, 0.1))
    y.set_step_mode(2)
    saved = x.saved()
    _, other, _ = board()
    told = other.restore(saved)
    assert "X.run_rate is 1000." in told
    assert other.saved() == saved
    assert not any("reset" in line for line in told)
    saved["step_size"] = 16
    assert other.restore(saved)[-1] == "The board was reset for its step size: both motors are at position 0."
    assert other.saved() == saved
    other.move_to(30_000)
    with pytest.raises(MotionFailed, match="motor X moves: stop it and wait"):
        other.restore(saved)


@pytest.mark.parametrize("place", range(30))
@pytest.mark.parametrize("verbose", VERBOSE)
def test_a_move_is_waited_for_whichever_character_that_comes_is_damaged(verbose: tuple[bool, bool], place: int) -> None:
    made = cell('[units.board]\nmodel = "bs0610"')
    port = FaultyPort(made)
    x = BlockingGenStepper(GenStepper("X"), port)
    x.set_verbose(first=verbose[0], delayed=verbose[1])
    port.damage(received=place)
    x.move_to(100)
    x.wait(20)
    status = made.controller("board").status(made.now, "X")
    assert (status.position, status.state) == (100, "ready")


def test_a_board_that_is_switched_off_does_not_answer() -> None:
    made, x, _ = board()
    made.power("board", False)
    with pytest.raises(NoAnswer, match="motor X of the GenStepper board: does not answer"):
        x.moving()


@pytest.mark.parametrize("baud", [2400, 4800, 9600])
def test_answers_are_waited_for_as_long_as_their_characters_take(baud: int) -> None:
    made = cell(f'[units.board]\nmodel = "bs0710"\noptions = {{ baud = {baud} }}')
    x = BlockingGenStepper(GenStepper("X", baud=baud), HostPort(made))
    x.set_verbose(delayed=True)
    x.set_position(-2_147_483_647)
    assert x.reports().position == -2_147_483_647
