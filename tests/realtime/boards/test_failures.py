"""What goes wrong with a board, and the state that it ends in: what is known of the position is said."""

from collections.abc import Callable
from random import Random
from typing import Any

import pytest
from tests.generated import seeds
from tests.realtime.boards.bench import ENABLE, EOT, MOV, SLIDE, Bench, bench, lossy, setup, slide

from detent.ramps import constant_acceleration
from detent.realtime.boards.board import State
from detent.realtime.boards.boards import Boards
from detent.realtime.boards.core import Core
from detent.realtime.boards.dictionary import Message
from detent.realtime.boards.events import CountDiffers, Lost, Ready, Recovered, Refusal, ShutDown, Stopped
from detent.realtime.boards.fake.board import FakeBoard
from detent.realtime.boards.fake.machine import MachineSwitch
from detent.realtime.boards.fake.port import FakePort
from detent.realtime.boards.ports import Look
from detent.realtime.boards.setup import (
    BoardSetup,
    DriverSetup,
    InputSetup,
    OutputSetup,
    Pin,
    SetupProblem,
    StepperSetup,
)
from detent.ticks import MS, SECOND, US, Ns

ENDLESS = constant_acceleration.move(1000, 1000, 1, None).train


def moving(**changes: Any) -> Bench:
    made = bench(**changes)
    made.boards.outputs["ENABLE"].set(True, made.now)
    made.move(ENDLESS, 1)
    made.run(300 * MS)
    return made


def goes_on(made: Bench, shaft: int) -> None:
    """From where the firmware says it stands, as a cell does that was cut there."""
    axis = made.axes["slide"]
    if axis.moving:
        axis.cut(made.now)
    made.told["slide"].clear()
    axis.shaft = shaft
    made.boards.steppers["slide"].rewind(shaft)
    made.move(constant_acceleration.move(200, 1500, 60, 200).train, -1)
    made.rest()
    assert made.boards.steppers["slide"].counted() == axis.shaft == shaft - 200
    assert not made.of(CountDiffers)


def test_an_emergency_stop_stops_at_once_and_keeps_the_position() -> None:
    made = moving()
    made.boards.emergency_stop(made.wall)
    before = made.machine.axes["slide"].position
    made.run(100 * MS)
    assert [event.reason for event in made.of(ShutDown)] == ["emergency stop"]
    assert made.machine.axes["slide"].position <= before + 1
    assert made.machine.outputs["gpio4"] is True  # active low: off
    # the cell goes on, and nothing leaves
    made.run(100 * MS)
    assert made.machine.axes["slide"].position <= before + 1
    made.boards.recover(made.wall)
    made.until(lambda: bool(made.of(Recovered)))
    shaft = made.of(Recovered)[0].shafts["slide"]
    assert shaft == made.machine.axes["slide"].position
    goes_on(made, shaft)


@pytest.mark.parametrize("reason", ["Timer too close", "Rescheduled timer in the past", "Stepper too far in past"])
def test_a_shutdown_is_told_by_its_reason(reason: str) -> None:
    made = moving()
    made.board.shut_down(reason)
    made.run(50 * MS)
    [event] = made.of(ShutDown)
    assert (event.board, event.reason) == ("left", reason)
    assert made.boards.boards["left"].state is State.SHUT_DOWN
    made.boards.recover(made.wall)
    made.until(lambda: bool(made.of(Recovered)))
    shaft = made.of(Recovered)[0].shafts["slide"]
    assert shaft == made.machine.axes["slide"].position
    goes_on(made, shaft)


def test_a_shutdown_whose_word_was_lost_is_told_by_the_next_answer() -> None:
    silent = False

    def spoil(data: bytes, to_board: bool) -> list[bytes]:
        return [] if silent and not to_board else [data]

    made = moving(port={"spoil": spoil})
    silent = True
    made.board.shut_down("Timer too close")
    made.run(3 * MS)
    silent = False
    made.run(100 * MS)
    assert [event.reason for event in made.of(ShutDown)] == ["Timer too close"]


def test_a_host_that_dies_leaves_the_motor_within_the_lead_and_the_outputs_at_their_default() -> None:
    made = moving()
    port, fake = made.ports[0], made.board
    position = made.machine.axes["slide"].position
    for _ in range(300):  # nobody is there
        port.run_to(made.wall)
        made.wall += 10 * MS
    assert made.machine.axes["slide"].position - position <= 31
    assert made.machine.outputs["gpio4"] is True
    assert fake.reason is not None
    # the next host clears it, and the count has gone on
    after = Bench([(setup(), FakePort(fake))])
    assert not after.of(Ready)[0].restarted
    stepper = after.boards.steppers["slide"]
    assert stepper._counted() == made.machine.axes["slide"].position
    stepper.adopt(7)
    after.axes["slide"].shaft = 7
    after.move(constant_acceleration.move(200, 1500, 60, 200).train, -1)
    after.rest()
    assert stepper.counted() == after.axes["slide"].shaft == -193
    assert not after.of(CountDiffers)


def test_a_host_that_comes_in_mid_move_finds_it_at_rest() -> None:
    """Whoever was there before has queued steps and directions: they end before this host reads a position."""
    made = moving()
    after = Bench([(setup(), FakePort(made.board))])
    assert not after.of(Ready)[0].restarted
    after.boards.steppers["slide"].adopt(0)
    here = made.machine.axes["slide"].position
    after.move(constant_acceleration.move(200, 1500, 60, 200).train, -1)
    after.rest()
    assert made.machine.axes["slide"].position == here - 200
    assert not after.of(CountDiffers)


@pytest.mark.parametrize("gone", range(0, 2400, 100))
def test_a_host_may_come_while_the_watchdog_of_another_runs_out(gone: int) -> None:
    """Started again by a service manager, say: whenever that is, the board is taken as it is found."""
    made = moving()
    for _ in range(gone // 10):  # nobody is there
        made.ports[0].run_to(made.wall)
        made.wall += 10 * MS
    after = Bench([(setup(), FakePort(made.board))])
    assert not after.of(Refusal)
    assert not after.of(Ready)[0].restarted
    after.boards.steppers["slide"].adopt(0)
    here = made.machine.axes["slide"].position
    after.move(constant_acceleration.move(200, 1500, 60, 200).train, -1)
    after.rest()
    assert made.machine.axes["slide"].position == here - 200


def test_an_unplugged_board_is_found_again_with_its_position() -> None:
    made = moving()
    made.ports[0].unplugged = True
    made.run(50 * MS)
    [lost] = made.of(Lost)
    assert "gone" in lost.reason
    made.ports[0].run_to(made.wall)  # it ends what it has
    made.boards.recover(made.wall)
    made.run(600 * MS)
    assert not made.of(Recovered)  # it is not there yet
    made.ports[0].unplugged = False
    made.until(lambda: bool(made.of(Recovered)))
    shaft = made.of(Recovered)[0].shafts["slide"]
    assert shaft == made.machine.axes["slide"].position
    goes_on(made, shaft)


def test_a_board_that_has_restarted_says_that_nothing_is_known() -> None:
    made = moving()
    made.board.power_cycle()
    made.run(50 * MS)
    assert made.of(Lost)
    made.boards.recover(made.wall)
    made.until(lambda: bool(made.of(Recovered)))
    assert made.of(Recovered)[0].shafts == {"slide": None}
    made.boards.steppers["slide"].adopt(0)
    made.axes["slide"].cut(made.now)
    made.told["slide"].clear()
    made.axes["slide"].shaft = 0
    here = made.machine.axes["slide"].position
    made.move(constant_acceleration.move(200, 1500, 60, 50).train, -1)
    made.rest()
    assert made.machine.axes["slide"].position == here - 50
    assert not made.of(CountDiffers)


def test_a_board_that_falls_silent_is_lost() -> None:
    made = moving(port={"spoil": lambda data, to_board: [data]})
    made.ports[0].spoil = lambda data, to_board: []
    made.run(5 * SECOND)
    assert [event.reason for event in made.of(Lost)] == ["it does not answer any more"]


@pytest.mark.parametrize("late", [2 * MS, 8 * MS, 25 * MS, 90 * MS, 400 * MS])
def test_a_board_whose_clock_falls_behind_has_lost_no_step(late: int) -> None:
    """Its last steps come later than the host thinks: the count is looked at again before it is believed."""
    made = bench()
    made.move(constant_acceleration.move(200, 1500, 60, 300).train, 1)
    made.until(lambda: not made.axes["slide"].moving)
    made.ports[0].stand(late)
    made.rest()
    assert made.boards.steppers["slide"].counted() == 300
    assert not made.of(CountDiffers)


@pytest.mark.parametrize("delay", [30 * MS, 90 * MS, 250 * MS])
def test_answers_on_a_slow_wire_are_not_taken_for_later_ones(delay: int) -> None:
    """A question is asked again every 40 ms: of a clock, answers to those would say that it stands."""
    port = FakePort(FakeBoard(slide()), delay=delay)
    made = Bench([(setup(), port)], start=False)
    made.boards.start(made.wall)
    made.until(lambda: made.boards.ready, 200 * SECOND)
    core = made.boards.master.core
    for _ in range(12):
        made.run(500 * MS)
        assert abs(core.clock.tick_at(made.wall) - port.tick_at(made.wall)) < core.ticks(5 * MS)


def test_a_count_of_before_a_stop_is_no_count_behind_it() -> None:
    """It was asked for again on a slow wire, and its second answer comes when another one is asked for."""
    core = Core(setup())
    core.dictionary = FakeBoard().dictionary
    found: list[int] = []

    def come(known: int, count: int) -> None:
        core.known = known
        core.answered(Message("stepper_position", {"oid": 1, "pos": count}), 0)

    def ask() -> None:
        core.ask(
            "stepper_get_position", "stepper_position", lambda message, _: found.append(message.number("pos")), 0, oid=1
        )

    ask()
    core.link.acknowledged = 1  # it was taken, and its answer lost
    core.due(50 * MS)
    come(1, 10)
    ask()
    come(2, 10)
    assert found == [10]
    come(3, 12)
    assert found == [10, 12]


def test_steps_that_went_missing_are_told_at_rest() -> None:
    made = bench()
    made.move(constant_acceleration.move(200, 1500, 60, 300).train, 1)
    made.run(200 * MS)
    made.board.oids[0].position -= 3  # not even the firmware did them
    made.rest()
    [differs] = made.of(CountDiffers)
    assert (differs.stepper, differs.shaft, differs.counted) == ("slide", 300, 297)


def test_steps_that_went_missing_are_told_though_rests_are_short() -> None:
    """Shorter than it takes to believe in a count at rest."""
    made = bench()
    for n in range(4):
        made.move(constant_acceleration.move(1000, 1000, 1, 100).train, 1 - n % 2 * 2)
        if n == 0:
            made.run(60 * MS)
            made.board.oids[0].position -= 3
        made.until(lambda: not made.axes["slide"].moving)
        made.run(50 * MS)
    assert {differs.counted - differs.shaft for differs in made.of(CountDiffers)} == {-3}


def test_a_board_with_another_configuration_is_started_again() -> None:
    for reset in ("reset", "config_reset"):
        fake = FakeBoard(slide(), reset=reset)
        first = Bench([(setup(), FakePort(fake))])
        second = Bench([(setup(outputs=(MOV,)), FakePort(fake))])
        assert second.of(Ready)[0].restarted
        assert fake.resets == 1
        second.move(constant_acceleration.move(200, 1500, 60, 50).train, 1)
        second.rest()
        assert second.boards.steppers["slide"].counted() == 50
        assert first.boards.ready


def test_a_board_that_keeps_its_port_is_started_again_too() -> None:
    """At a UART the port stays when the board is reset."""

    class AtUart(FakeBoard):
        def power_cycle(self) -> None:
            super().power_cycle()
            self.gone = False

    fake = AtUart(slide())
    Bench([(setup(), FakePort(fake))])
    second = Bench([(setup(outputs=(MOV,)), FakePort(fake))])
    assert second.of(Ready)[0].restarted
    assert fake.resets == 1


@pytest.mark.parametrize("gone_for", [0, 400 * MS])
@pytest.mark.parametrize("wait", [0, 200 * US, 20 * MS, 300 * MS])
def test_a_board_that_is_stopped_while_it_starts_again_waits_for_recover(wait: Ns, gone_for: Ns) -> None:
    """It does not come back by itself, and when it does, it is said that nobody knows where its axis stands."""
    made = bench()
    made.ports[0].unplugged = True
    made.run(1500 * MS)
    made.board.power_cycle()
    made.board.finalized, made.board.crc = True, 77  # another host had it meanwhile
    made.ports[0].unplugged = False
    made.boards.recover(made.wall)
    made.until(lambda: made.boards.master.wants_reopening)
    end = made.wall + wait
    while made.wall < end:
        made.turn(min(end, made.wall + 50 * US))
        made.ports[0].unplugged = made.ports[0].unplugged or bool(gone_for and made.board.resets == 2)
    made.boards.emergency_stop(made.wall)
    made.run(gone_for)
    made.ports[0].unplugged = False
    made.run(3 * SECOND)
    assert not made.boards.ready
    assert not made.of(Recovered) or wait == 300 * MS
    made.boards.recover(made.wall)
    made.until(lambda: made.boards.ready)
    assert len(made.of(Ready)) == 1  # at the start
    assert made.of(Recovered)[0].shafts == {"slide": None}


def refusal(made: BoardSetup, fake: FakeBoard | None = None, port: dict[str, Any] | None = None) -> Refusal:
    bad = Bench([(made, FakePort(fake or FakeBoard(slide()), **(port or {})))], start=False)
    bad.boards.start(bad.wall)
    bad.until(lambda: bool(bad.of(Refusal)))
    assert not bad.boards.ready
    return bad.of(Refusal)[0]


@pytest.mark.parametrize(
    ("changes", "fake", "where", "said"),
    [
        ({"inputs": (InputSetup("EOT", Pin("gpoi10")), )}, {}, ("EOT", "pin"), "no pin gpoi10; it has gpio10"),
        ({"outputs": (OutputSetup("MOV", Pin("gpio1")),)}, {}, ("MOV", "pin"), "needs gpio1 itself, for serial"),
        ({}, {"leave_out": ("config_trsync", "buttons_query")}, ("", ""), "has no config_trsync, buttons_query; flash"),
        ({}, {"window": 64}, ("", ""), "takes 64 bytes at once (RECEIVE_WINDOW)"),
        ({"outputs": (OutputSetup("E", Pin("gpio4"), watchdog=60 * SECOND),)}, {"frequency": 72_000_000},
         ("E", "watchdog"), "take 14 s or less"),
        ({"drivers": (DriverSetup("d", "tmc5160", 0.1, select=Pin("gpio20"), bus="spi9"),)}, {}, ("d", "bus"),
         "no spi bus spi9; it has spi"),
    ],
)  # fmt: skip
def test_a_board_that_cannot_be_used_so_is_refused(
    changes: dict[str, Any], fake: dict[str, Any], where: tuple[str, str], said: str
) -> None:
    found = refusal(setup(**changes), FakeBoard(slide(), **fake))
    assert (found.item, found.key) == where
    assert said in found.text


def test_something_that_is_no_board_is_refused() -> None:
    found = refusal(setup(), port={"spoil": lambda data, to_board: []})
    assert "does not answer as a board with Klipper firmware" in found.text


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: setup(outputs=(OutputSetup("MOV", Pin("gpio2")),)), "MOV.pin: the pin gpio2 is taken by slide.step"),
        (lambda: setup(inputs=(EOT, InputSetup("EOT", Pin("gpio30")))), "two things of that name"),
        (lambda: setup(lead=10 * MS), "left.lead: a lead of 10 ms is too short for a margin of 4 ms"),
        (lambda: setup(outputs=(OutputSetup("E", Pin("gpio4"), watchdog=50 * MS),)), "E.watchdog: 50 ms is less than"),
        (lambda: setup(inputs=(InputSetup("EOT", Pin("gpio10"), samples=0),)), "EOT.sample: an input is sampled"),
        (lambda: setup(steppers=(StepperSetup("s", Pin("gpio2"), Pin("gpio3"), stops=("LX",)),)), "LX is no input"),
    ],
)
def test_a_setup_that_fits_no_board(make: Callable[[], BoardSetup], said: str) -> None:
    with pytest.raises(SetupProblem, match=said.replace(".", r"\.")):
        make().check()


@pytest.mark.parametrize("text", ["", "!", "!!gpio3", "^~gpio3", "gpio 3", "gpio3!"])
def test_pins_that_are_none(text: str) -> None:
    with pytest.raises(ValueError, match="write it like"):
        Pin.parse(text)


def test_pins_as_users_write_them() -> None:
    assert Pin.parse(" !^gpio3") == Pin.parse("^!gpio3") == Pin("gpio3", True, 1)
    assert Pin.parse("~PA4") == Pin("PA4", False, -1)
    assert str(Pin("gpio3", True, 1)) == "!^gpio3"


def test_a_host_that_slept_does_not_take_its_board_for_lost() -> None:
    """Nobody has asked it anything meanwhile."""
    made = bench(outputs=(MOV,))
    made.run(1 * SECOND)
    made.turn(made.wall + 4 * SECOND)
    made.run(100 * MS)
    assert not made.of(Lost)
    assert made.boards.ready


def test_a_board_is_looked_at_and_left_as_it_was() -> None:
    fake = FakeBoard(leave_out=("config_tmcuart", "tmcuart_send"))
    look = Look(FakePort(fake))
    wall = 0
    look.start(wall)
    while not look.turn(wall):
        wall = max(wall + 1000, look.deadline() or 0)
    found = look.found
    assert found is not None
    assert (found.firmware, found.mcu, found.frequency, found.move_count) == ("fake-1", "fake", 16_000_000, 0)
    assert len(found.pins) == 64
    assert found.missing == ("config_tmcuart", "tmcuart_send")
    assert not fake.finalized


@pytest.mark.parametrize("seed", seeds(8))
def test_a_bad_wire_costs_no_step(seed: int) -> None:
    """Lost, doubled and damaged blocks both ways: moves, a stop and outputs come out right."""
    random = Random(seed)
    limit = MachineSwitch("slide", "gpio10", 300, 1 << 30, inside=False)
    usual, spoilt = lossy(random, 0.03), []

    def spoil(data: bytes, to_board: bool) -> list[bytes]:
        found = usual(data, to_board)
        spoilt.append(found != [data])
        return found

    made = bench(limit, lead=60 * MS, port={"spoil": spoil, "delay": 200 * US}, board={"seed": seed})
    for steps, direction in ((150, 1), (90, -1)):
        made.move(constant_acceleration.move(200, 1500, 60, steps).train, direction)
        made.rest()
        assert made.machine.axes["slide"].position == made.axes["slide"].shaft
    made.boards.stops["slide"].arm({"EOT": False}, made.now)
    made.boards.outputs["MOV"].set(True, made.now)
    made.move(ENDLESS, 1)
    made.until(lambda: bool(made.of(Stopped)))
    assert made.of(Stopped)[0].shaft == made.machine.axes["slide"].position == 300
    assert made.machine.outputs["gpio6"] is True
    assert sum(spoilt) > 1
    assert not made.of(CountDiffers)


def test_two_boards_keep_one_time() -> None:
    """The second board's clock runs 150 millionths slow, in other ticks: its steps keep their times all the same."""
    right = StepperSetup("cross", Pin("gpio2"), Pin("gpio3"))
    fakes = [FakeBoard(slide(), frequency=16_000_000), FakeBoard(slide(), frequency=12_000_000, seed=3)]
    made = Bench([
        (setup(), FakePort(fakes[0], drift=80)),
        (BoardSetup("right", steppers=(right,)), FakePort(fakes[1], drift=-70)),
    ])  # fmt: skip
    made.run(4 * SECOND)  # until the clocks are known
    train = constant_acceleration.move(100, 500, 50, 600).train
    made.move(train, 1)
    made.move(train, 1, "cross")
    made.rest()
    made.rest("cross")
    walls = [
        [port.wall_at(tick) for tick, _, _ in fake.machine.steps] for port, fake in zip(made.ports, fakes, strict=True)
    ]
    assert len(walls[0]) == len(walls[1]) == 600
    assert max(abs(a - b) for a, b in zip(*walls, strict=True)) < 100 * US
    assert made.boards.steppers["cross"].counted() == 600


def test_boards_that_do_not_go_together() -> None:
    other = BoardSetup("right", lead=50 * MS)
    with pytest.raises(SetupProblem, match="the same lead"):
        Boards([(setup(), FakePort(FakeBoard())), (other, FakePort(FakeBoard()))])
    with pytest.raises(SetupProblem, match="it is on left and on right"):
        Boards([(setup(), FakePort(FakeBoard())), (BoardSetup("right", steppers=(SLIDE,)), FakePort(FakeBoard()))])
    with pytest.raises(SetupProblem, match="two boards of that name"):
        Boards([(setup(), FakePort(FakeBoard())), (BoardSetup("left"), FakePort(FakeBoard()))])


def test_an_output_with_a_watchdog_is_fed_at_rest() -> None:
    made = bench()
    made.boards.outputs["ENABLE"].set(True, made.now)
    made.run(20 * SECOND)
    assert made.machine.outputs["gpio4"] is False
    assert made.boards.ready
    assert ENABLE.watchdog is not None
