"""Stops in the firmware: at the step that closed the switch, and counts that stay equal whatever happens."""

from random import Random

import pytest
from tests.generated import seeds
from tests.realtime.boards.bench import Bench, bench, lossy

from detent.axis import MotionStarted
from detent.pulses import Train, Uniform
from detent.ramps import constant_acceleration
from detent.realtime.boards.events import CountDiffers, InputChanged, Ready, Stopped
from detent.realtime.boards.fake.machine import MachineSwitch
from detent.realtime.boards.guard import Guard
from detent.ticks import MS, SECOND, US, Ns

LIMIT = MachineSwitch("slide", "gpio10", 500, 1 << 30, inside=False)  # EOT: low beyond


def move(made: Bench, steps: int | None, direction: int, rate: int = 1000) -> MotionStarted:
    made.boards.stops["slide"].arm({"EOT": False}, made.now)
    made.move(constant_acceleration.move(rate, rate, 1, steps).train, direction)
    [started] = made.told["slide"]
    assert isinstance(started, MotionStarted)
    return started


def taken_back(made: Bench, stop: Stopped, started: MotionStarted) -> None:
    """What the cell does: it is taken back to the stop, cut there, and the axis stands where the firmware counts."""
    axis = made.axes["slide"]
    at = min(max(stop.at, started.at), made.now)
    given = (stop.shaft - started.shaft) * started.direction
    # the instant lies between the pulses that the firmware has counted and the next
    assert started.train.steps_by(at) == given
    made.axes["slide"].train = started.train
    axis.cut(at)
    made.told["slide"].clear()
    made.boards.steppers["slide"].rewind(stop.shaft)
    assert axis.shaft == stop.shaft


@pytest.mark.parametrize("rate", [10, 200, 1000, 5000])
def test_it_stops_on_the_step_that_closed_the_switch(rate: int) -> None:
    edge = 500 if rate > 50 else 6
    made = bench(MachineSwitch("slide", "gpio10", edge, 1 << 30, inside=False))
    started = move(made, None, 1, rate)
    made.until(lambda: bool(made.of(Stopped)), 60 * SECOND)
    [stop] = made.of(Stopped)
    assert (stop.stepper, stop.input, stop.level, stop.present) == ("slide", "EOT", False, False)
    assert stop.shaft == made.machine.axes["slide"].position == edge
    # two samples of 50 us behind the pulse at most
    pulse = started.train.time_of(edge)
    assert 0 <= stop.edge - pulse <= 55 * US
    assert stop.edge <= stop.at <= stop.edge + 51 * US
    taken_back(made, stop, started)
    made.run(200 * MS)
    assert made.machine.axes["slide"].position == edge
    assert not made.of(CountDiffers)


@pytest.mark.parametrize("away", [1 * SECOND, 3 * SECOND, 5 * SECOND, 7 * SECOND, 60 * SECOND])
@pytest.mark.parametrize("frequency", [12_000_000, 520_000_000])
def test_when_it_was_is_known_however_long_the_computer_was_away(frequency: int, away: Ns) -> None:
    """The instant comes in the 32 bits of a clock that goes round in 8 s at 520 MHz."""
    made = bench(MachineSwitch("slide", "gpio10", 40, 1 << 30, inside=False), board={"frequency": frequency})
    started = move(made, None, 1, 200)
    made.run(205 * MS)
    assert not made.of(Stopped)
    made.turn(made.wall + away)
    made.until(lambda: bool(made.of(Stopped)))
    [stop] = made.of(Stopped)
    assert stop.input == "EOT"
    assert stop.shaft == made.machine.axes["slide"].position == 40
    assert 0 <= stop.edge - started.train.time_of(40) <= 55 * US
    assert stop.edge <= stop.at <= stop.edge + 51 * US


def test_and_goes_away_from_it_again() -> None:
    made = bench(LIMIT)
    started = move(made, None, 1)
    made.until(lambda: bool(made.of(Stopped)))
    taken_back(made, made.of(Stopped)[0], started)
    made.boards.stops["slide"].disarm()
    made.move(constant_acceleration.move(1000, 1000, 1, 300).train, -1)
    made.rest()
    assert made.machine.axes["slide"].position == made.axes["slide"].shaft == 200
    # the switch opened while nothing was armed: told as any other input
    assert [event.level for event in made.of(InputChanged)] == [True]
    assert not made.of(CountDiffers)


def test_a_switch_that_is_closed_already_lets_no_step_pass() -> None:
    made = bench(MachineSwitch("slide", "gpio10", 0, 1 << 30, inside=False))
    assert made.boards.master.inputs == {"EOT": False, "HOME": True}
    started = move(made, None, 1, 5000)
    made.until(lambda: bool(made.of(Stopped)))
    [stop] = made.of(Stopped)
    assert stop.shaft == 0 == made.machine.axes["slide"].position
    assert started.train.steps_by(stop.at) == 0


def test_arming_late_holds_the_pulses_back() -> None:
    """A stop that is armed for the past comes into force now: no pulse leaves before it."""
    made = bench(MachineSwitch("slide", "gpio10", 0, 1 << 30, inside=False))
    move(made, 400, 1, 2000)
    made.turn(made.wall + 28 * MS)  # the host was busy meanwhile
    assert made.boards.steppers["slide"].lag > 1 * MS
    made.until(lambda: bool(made.of(Stopped)))
    assert made.of(Stopped)[0].shaft == made.machine.axes["slide"].position == 0


@pytest.mark.parametrize("more", [0, 137 * US, 500 * US, 999 * US, 1001 * US])
def test_a_stop_for_what_follows_stops_nothing_of_what_was_before_however_late_its_pulses_are(more: int) -> None:
    """EOT is at its level when it is armed, and pulses of the motion before have yet to leave: they leave first.

    Also the pulse of the very instant at which the next motion begins.
    """
    made = bench(MachineSwitch("slide", "gpio10", -(1 << 30), 1 << 30, inside=False))
    made.move(constant_acceleration.move(1000, 1000, 1, None).train, 1)
    made.run(50 * MS)
    made.turn(made.wall + 60 * MS)
    made.run(10 * MS + more)
    assert made.boards.steppers["slide"].lag > 30 * MS
    axis = made.axes["slide"]
    axis.cut(made.now)
    here = axis.shaft
    made.boards.stops["slide"].arm({"EOT": False}, made.now)
    made.move(constant_acceleration.move(1000, 1000, 1, None).train, -1)
    made.until(lambda: bool(by_input(made)))
    assert by_input(made)[0].shaft == here == made.machine.axes["slide"].position > 100


def by_input(made: Bench) -> list[Stopped]:
    return [stop for stop in made.of(Stopped) if not stop.dry]


def test_what_is_armed_stays_armed_while_it_is_armed_again() -> None:
    """No gap and no new trigger: the tail of a motion is guarded while the next is armed."""
    made = bench(LIMIT)
    move(made, 495, 1)
    made.until(lambda: not made.axes["slide"].moving)
    before = len(made.board.log)
    made.boards.stops["slide"].arm({"EOT": False, "HOME": False}, made.now)
    made.turn(made.wall)
    made.run(5 * MS)
    since = [(name, values.get("oid")) for _, name, values in made.board.log[before:]]
    triggers = ("trsync_start", "trsync_trigger", "endstop_home")
    assert [name for name, _ in since if name in triggers] == ["endstop_home"]
    made.move(constant_acceleration.move(1000, 1000, 1, 100).train, 1)
    made.until(lambda: bool(made.of(Stopped)))
    assert made.of(Stopped)[0].shaft == 500


def test_disarmed_it_stops_nothing() -> None:
    made = bench(LIMIT)
    move(made, 600, 1)
    made.run(100 * MS)
    made.boards.stops["slide"].disarm()
    made.rest()
    assert not made.of(Stopped)
    assert made.machine.axes["slide"].position == 600
    # and the trigger is quiet: a board at rest is not talked at
    reports = [m for m in made.board.log if m[1] == "trsync_start"]
    assert reports[-1][2]["report_ticks"] == 0


def test_a_trigger_on_its_way_while_it_is_disarmed_is_told() -> None:
    """The switch closes, and the host disarms before it has heard of it: the stop comes all the same."""
    for delay in (0, 1, 2, 3, 5):
        made = bench(LIMIT, port={"delay": 2 * MS})
        move(made, None, 1)
        made.until(lambda made=made: made.machine.axes["slide"].position >= 500)
        made.run(delay * MS)
        if not made.of(Stopped):
            made.boards.stops["slide"].disarm()
        made.until(lambda made=made: bool(made.of(Stopped)))
        assert made.of(Stopped)[0].shaft == 500


@pytest.mark.parametrize("late", range(0, 6000, 250))
def test_a_stop_says_the_level_for_which_it_was_armed_when_it_fired(late: int) -> None:
    """The host arms it for the other level before it has heard: what was armed last has stopped nothing."""
    made = bench(port={"delay": 1 * MS})
    made.machine.set("gpio10", False, made.board.now)
    made.run(10 * MS)
    made.boards.stops["slide"].arm({"EOT": True}, made.now)
    made.move(constant_acceleration.move(1000, 1000, 1, 400).train, 1)
    made.run(60 * MS)
    made.ports[0].run_to(made.wall)
    made.machine.set("gpio10", True, made.board.now)
    made.run(late * US + 1)
    made.boards.stops["slide"].arm({"EOT": False}, made.now)
    made.until(lambda: bool(made.of(Stopped)))
    [stop] = made.of(Stopped)
    assert (stop.input, stop.level, stop.present) == ("EOT", True, True)


def test_a_glitch_shorter_than_two_samples_stops_nothing_and_a_longer_one_is_told_as_over() -> None:
    for length, stops in ((40, False), (400, True)):
        made = bench()
        made.machine.set("gpio10", True, made.board.now)
        made.run(10 * MS)
        move(made, 1000, 1)
        made.run(300 * MS)
        board = made.board
        board.at(board.now + 1000, lambda tick, made=made: made.machine.set("gpio10", False, tick))
        over = board.now + 1000 + length * board.frequency // 1_000_000
        board.at(over, lambda tick, made=made: made.machine.set("gpio10", True, tick))
        made.run(60 * MS)
        assert [stop.present for stop in made.of(Stopped)] == ([True] if stops else [])
        assert not made.of(InputChanged)


def test_the_button_report_of_an_armed_level_is_left_to_the_trigger() -> None:
    made = bench(LIMIT)
    started = move(made, None, 1)
    made.until(lambda: bool(made.of(Stopped)))
    taken_back(made, made.of(Stopped)[0], started)
    made.run(100 * MS)
    assert not made.of(InputChanged)
    assert made.boards.master.inputs["EOT"] is False


def prove_stop(seed: int) -> None:
    """Homings and limits at any rate, lead and queue: the count is the firmware's, no step behind the stop."""
    random = Random(seed)
    lead = random.choice([12, 15, 30, 50])
    edge, rate = random.randrange(1, 400), random.choice([20, 100, 170, 900, 2500, 5000])
    if rate < 100:
        edge = min(edge, 30)
    made = bench(
        MachineSwitch("slide", "gpio10", edge, 1 << 30, inside=False), lead=lead * MS,
        board={"seed": seed, "moves": random.choice([48, 512])},
        port={"drift": random.uniform(-100, 100), "delay": random.choice([50, 300, 1000]) * US},
    )  # fmt: skip
    started = move(made, random.choice([None, edge + 1, edge + 50]), 1, rate)
    made.until(lambda: bool(made.of(Stopped)), 60 * SECOND)
    [stop] = made.of(Stopped)
    assert stop.shaft == edge == made.machine.axes["slide"].position
    if made.axes["slide"].moving:
        taken_back(made, stop, started)
    else:  # the rest of its pulses were told already: it is taken back from rest
        made.axes["slide"].shaft = stop.shaft
        made.boards.steppers["slide"].rewind(stop.shaft)
    last = made.machine.steps[-1][0]
    made.run(2 * lead * MS)
    assert made.machine.steps[-1][0] == last
    made.boards.stops["slide"].arm({"EOT": True}, made.now)  # back until it opens
    made.move(constant_acceleration.move(rate, rate, 1, None).train, -1)
    made.until(lambda: len(made.of(Stopped)) == 2, 10 * SECOND)
    assert made.of(Stopped)[1].shaft == edge - 1 == made.machine.axes["slide"].position
    assert not made.of(CountDiffers)


@pytest.mark.parametrize("seed", seeds(12))
def test_random_stops(seed: int) -> None:
    prove_stop(seed)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(5))
def test_five_hundred_random_stops(part: int) -> None:
    for seed in range(100 * part, 100 * part + 100):
        prove_stop(seed)


def test_a_lost_report_is_followed_by_another() -> None:
    """What a board sends is not repeated by the link: a trigger whose word was lost is heard of a report later."""
    dropped: list[bytes] = []

    def spoil(data: bytes, to_board: bool) -> list[bytes]:
        if not to_board and armed and made.board.machine.axes["slide"].position >= 500 and len(dropped) < 6:
            dropped.append(data)
            return []
        return [data]

    armed = False
    made = bench(LIMIT, port={"spoil": spoil})
    armed = True
    move(made, None, 1)
    made.until(lambda: bool(made.of(Stopped)))
    assert len(dropped) == 6
    assert made.of(Stopped)[0].shaft == 500


def told_in_order(seed: int) -> None:
    """A hand at the inputs, before a stop and behind it, and a wire on which answers are lost."""
    random = Random(seed)
    usual, bad = lossy(random, 0.3), False

    def spoil(data: bytes, to_board: bool) -> list[bytes]:
        return usual(data, to_board) if bad and not to_board else [data]

    made = bench(port={"spoil": spoil})
    made.machine.set("gpio10", True, made.board.now)
    made.run(20 * MS)
    move(made, 2000, 1)
    made.run(60 * MS)
    bad = True
    for _ in range(8):
        made.machine.set(random.choice(["gpio10", "gpio11"]), random.random() < 0.5, made.board.now)
        made.run(random.randrange(20 * MS) + 1)
    bad = False
    made.run(600 * MS)
    [ready] = made.of(Ready)
    levels = dict(ready.inputs)
    for event in made.events:
        if isinstance(event, Stopped):
            levels |= event.levels
        elif isinstance(event, InputChanged):
            levels[event.input] = event.level
    assert levels == made.boards.master.inputs
    assert levels == {"EOT": made.machine.level("gpio10"), "HOME": not made.machine.level("gpio11")}


def test_events_say_in_their_order_what_every_input_is_at() -> None:
    """A stop that was long in coming, for want of an answer, does not say again what an input was at before."""
    for seed in seeds(60):
        told_in_order(seed)


def test_the_host_hears_of_it_within_the_lead_and_some_ms() -> None:
    """The host hears of a stop within a few ms of it, of its own time."""
    made = bench(LIMIT, port={"delay": 100 * US})
    move(made, None, 1)
    made.until(lambda: bool(made.of(Stopped)))
    [stop] = made.of(Stopped)
    assert made.now - stop.at < 40 * MS


@pytest.mark.parametrize("late", range(0, 600, 60))
def test_no_step_follows_a_stop_that_fires_before_the_first_steps_are_sent(late: int) -> None:
    """The word of it is still on the wire when the host sends the first pulses since the last stop: none is taken."""
    made = bench()
    made.machine.set("gpio10", True, made.board.now)
    made.run(10 * MS)
    made.boards.stops["slide"].arm({"EOT": False}, made.now)
    made.move(Train((Uniform(0, 40 * MS, 1, 20),)), 1)
    made.run(40 * MS - 100 * US)
    assert not made.machine.steps
    made.ports[0].run_to(made.wall)
    made.machine.set("gpio10", False, made.board.now)
    made.turn(made.wall + late * US)
    made.run(100 * MS)
    assert len(made.of(Stopped)) == 1
    made.boards.steppers["slide"].rewind(0)
    made.run(200 * MS)
    assert not made.machine.steps


def test_what_was_armed_before_a_stop_was_heard_of_does_not_pass_for_armed() -> None:
    """The stepper ran dry, and an input was let go meanwhile: it is guarded from the first step of what comes later."""
    made = bench(MachineSwitch("slide", "gpio10", 60, 1 << 30, inside=False))
    stop, stepper, dry = made.boards.stops["slide"], made.boards.steppers["slide"], []
    guard = Guard(stop)
    guard.want({"EOT": 0, "HOME": 0}, made.now, made.now)
    made.move(constant_acceleration.move(1000, 1000, 1, 400).train, 1)
    [started] = made.told["slide"]

    def hear() -> None:
        for event in made.boards.events():
            made.events.append(event)
            if isinstance(event, Stopped) and event.dry:
                stop.arm({"EOT": False}, made.now)  # of before it was heard of
                guard.fired()
                guard.want({"EOT": 0}, started.train.time_of(event.shaft + 1) - 1, made.now)
                stepper.rewind(event.shaft, slipped=True)
                stepper.tell(started)
                dry.append(event)

    made.hear = hear  # type: ignore[method-assign]
    made.run(50 * MS)
    made.turn(made.wall + 70 * MS)
    made.until(lambda: bool(by_input(made)))
    assert len(dry) == 1
    assert dry[0].shaft < 60
    assert by_input(made)[0].shaft == 60 == made.machine.axes["slide"].position
