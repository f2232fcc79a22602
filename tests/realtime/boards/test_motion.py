"""Steps on a fake board are the pulses of the axis: every one, at its time, whatever the axis decides meanwhile."""

from fractions import Fraction
from random import Random

import pytest
from tests.generated import seeds
from tests.realtime.boards.bench import SLIDE, Bench, bench

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.pulses import Train, Uniform
from detent.ramps import constant_acceleration, tick_accumulator, timer_table
from detent.realtime.boards.events import CountDiffers, Slipped
from detent.realtime.boards.setup import Pin, StepperSetup
from detent.ticks import MS, SECOND, US, Ns


class Pulses:
    """What an axis says it gives, kept apart from the code under test."""

    def __init__(self) -> None:
        self.times: list[tuple[Ns, int]] = []
        self._open: MotionStarted | None = None

    def take(self, entry: MotionStarted | MotionCut | MotionEnded) -> None:
        if isinstance(entry, MotionStarted):
            self._close(entry.first - 1)
            self._open = entry
        else:
            self._close(entry.last)
            self._open = None

    def _close(self, last: int) -> None:
        if self._open is not None:
            entry = self._open
            self.times += [(entry.train.time_of(n), entry.direction) for n in range(entry.first, last + 1)]


def recorded(made: Bench) -> dict[str, Pulses]:
    """The pulses of each axis, from now on."""
    kept = {name: Pulses() for name in made.axes}
    for name, stepper in made.boards.steppers.items():
        tell = stepper.tell

        def told(entry: object, tell: object = tell, pulses: Pulses = kept[name]) -> None:
            pulses.take(entry)  # type: ignore[arg-type]
            tell(entry)  # type: ignore[operator]

        stepper.tell = told  # type: ignore[method-assign]
    return kept


def edges_are(made: Bench, pulses: Pulses, error: Ns, axis: str = "slide", lag: int = 0) -> None:
    """Each step edge of the machine is within error + 1 tick of its pulse's time, a lead later."""
    scale = made.boards.master.core.scale
    frequency = made.board.frequency
    steps = [(tick, position) for tick, name, position in made.machine.steps if name == axis]
    assert len(steps) == len(pulses.times)
    position = 0
    for (tick, at), (time, direction) in zip(steps, pulses.times, strict=True):
        position += direction
        assert at == position
        due = Fraction((time - scale.zero) * frequency, SECOND) + scale.offset + lag
        assert abs(tick - due) <= Fraction(error * frequency, SECOND) + 1


def counts_agree(made: Bench, axis: str = "slide") -> None:
    assert made.machine.axes[axis].position == made.axes[axis].shaft == made.boards.steppers[axis].counted()
    assert not made.of(CountDiffers)


TRAINS: dict[str, Train] = {
    "constant acceleration": constant_acceleration.move(200, 4000, 300, 1500).train,
    "timer table": timer_table.index(
        timer_table.Speeds(timer_table.count_of(400), timer_table.count_of(5000), 4, 4, 1), 1200).train,
    "ticked": tick_accumulator.toward(1200, 0, 0, 6000, 20_000, 100, 20_000).train,
}  # fmt: skip


@pytest.mark.parametrize("law", TRAINS)
@pytest.mark.parametrize("error", ["exact", 1 * US, 25 * US])
def test_a_move_is_stepped_as_it_was_made(law: str, error: Ns | str) -> None:
    made = bench(error=error)
    kept = recorded(made)
    made.move(TRAINS[law], 1)
    made.rest()
    made.move(TRAINS[law], -1)
    made.rest()
    edges_are(made, kept["slide"], 0 if error == "exact" else int(error))
    counts_agree(made)
    assert not made.of(Slipped)


def test_an_exact_pulse_is_on_its_nearest_tick() -> None:
    made = bench(error="exact")
    kept = recorded(made)
    made.move(TRAINS["constant acceleration"], 1)
    made.rest()
    scale = made.boards.master.core.scale
    assert [tick for tick, _, _ in made.machine.steps] == [scale.tick(time) for time, _ in kept["slide"].times]


@pytest.mark.parametrize("seconds", [25, *(pytest.param(seconds, marks=pytest.mark.slow) for seconds in (150, 270))])
def test_slow_pulses_go_on_from_the_last_one(seconds: int) -> None:
    """A step in 25 s is more than 2**28 ticks of 16 MHz, one in 150 s more than 2**31, one in 270 s more than 2**32.

    The step clock is set once all the same: a stop that the host has not heard of takes no step.
    """
    made = bench()
    made.stride = 200 * MS
    kept = recorded(made)
    period = seconds * SECOND
    made.move(Train((Uniform(0, period, 1, 2),)), 1)
    made.rest(most=4 * period)
    assert [name for _, name, _ in made.board.log if name == "reset_step_clock"] == ["reset_step_clock"]
    edges_are(made, kept["slide"], 1 * US)
    counts_agree(made)


def test_nothing_leaves_before_it_is_certain() -> None:
    """A cut in the present stops every later pulse, though the train was compressed far ahead."""
    made = bench()
    kept = recorded(made)
    made.move(constant_acceleration.move(100, 4000, 200, None).train, 1)
    made.run(200 * MS)
    made.axes["slide"].cut(made.now)
    made.rest()
    edges_are(made, kept["slide"], 1 * US)
    counts_agree(made)


def random_program(made: Bench, random: Random, commands: int) -> None:
    """Starts, changes of mind, cuts and rests."""
    axis = made.axes["slide"]
    for _ in range(commands):
        choice = random.randrange(6)
        if not axis.moving:
            speeds = random.randrange(20, 1000), random.randrange(50, 8000), random.randrange(1, 300)
            steps = random.choice([None, random.randrange(1, 40), random.randrange(1, 900)])
            made.move(constant_acceleration.move(*speeds, steps).train, random.choice([1, -1]))
        elif choice < 2:
            axis.cut(made.now)
        elif choice < 4:
            replan_to_stop(made, random)
        elif choice == 4:
            axis.gate(False, made.now)
            made.turn(made.wall)
            made.run(random.randrange(1, 30 * MS))
            axis.gate(True, made.now)
        made.turn(made.wall)
        made.run(random.choice([0, 1, random.randrange(60 * MS), random.randrange(300 * MS)]))
    if axis.moving:
        axis.cut(made.now)
    made.turn(made.wall)


def replan_to_stop(made: Bench, random: Random) -> None:
    """The same train, ending some steps from now."""
    axis = made.axes["slide"]
    assert axis.train is not None
    last = axis.given(made.now) + random.randrange(1, 50)
    if axis.train.steps is None or axis.train.steps > last:
        train = axis.train.head(last)
        axis.replan(train, (last,), made.now)


def prove_program(seed: int) -> None:
    random = Random(seed)
    clock, moves = random.choice([12, 16, 50]) * 1_000_000, random.choice([32, 64, 512])
    made = bench(
        board={"seed": seed, "moves": moves, "frequency": clock},
        port={"drift": random.uniform(-200, 200), "delay": random.choice([20, 200, 900]) * US},
    )
    kept = recorded(made)
    for _ in range(3):
        random_program(made, random, 6)
        made.rest()
        counts_agree(made)
    assert not made.of(Slipped)
    edges_are(made, kept["slide"], 1 * US)
    assert made.boards.ready


@pytest.mark.parametrize("seed", seeds(16))
def test_random_programs(seed: int) -> None:
    prove_program(seed)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(10))
def test_a_thousand_random_programs(part: int) -> None:
    for seed in range(100 * part, 100 * part + 100):
        prove_program(seed)


def test_a_clock_for_each_direction() -> None:
    """Pulses of direction - come on a pin of their own, and the two counts are one shaft."""
    pulses = StepperSetup("slide", Pin("gpio2"), Pin("gpio9"), minus=Pin("gpio5"))
    made = bench(steppers=(pulses,))
    made.machine.axes["slide"].minus, made.machine.axes["slide"].dir = "gpio5", None
    made.move(TRAINS["constant acceleration"], 1)
    made.rest()
    made.move(constant_acceleration.move(200, 2000, 100, 400).train, -1)
    made.rest()
    assert made.machine.axes["slide"].position == 1100
    counts_agree(made)


def test_a_direction_pin_that_is_active_low() -> None:
    made = bench(steppers=(StepperSetup("slide", SLIDE.step, Pin.parse("!gpio3")),))
    made.machine.axes["slide"].reverse = True
    made.move(TRAINS["constant acceleration"], -1)
    made.rest()
    assert made.machine.axes["slide"].position == -1500
    counts_agree(made)


# -- what is late


def test_a_host_that_was_kept_away_slips_once() -> None:
    """A stall of 60 ms with a lead of 30: one slip, no shutdown, counts equal."""
    made = bench()
    kept = recorded(made)
    made.move(constant_acceleration.move(200, 1000, 50, 1000).train, 1)
    made.run(300 * MS)
    made.turn(made.wall + 60 * MS)
    made.rest()
    [slip] = made.of(Slipped)
    assert 30 * MS < slip.by < 60 * MS
    assert made.boards.steppers["slide"].slips == 1
    counts_agree(made)
    # before it nothing is moved, behind it everything by the same
    before = sum(time < slip.at for time, _ in kept["slide"].times)
    scale, steps = made.boards.master.core.scale, made.machine.steps
    lag = made.boards.steppers["slide"].lag_at(steps[-1][0])
    for number, ((tick, _, _), (time, _)) in enumerate(zip(steps, kept["slide"].times, strict=True)):
        due = scale.tick(time) + (lag if number >= before else 0)
        assert abs(tick - due) <= 17


def test_the_lag_is_gone_behind_a_rest() -> None:
    made = bench()
    made.move(constant_acceleration.move(200, 1000, 50, 400).train, 1)
    made.run(100 * MS)
    made.turn(made.wall + 60 * MS)
    made.rest()
    stepper = made.boards.steppers["slide"]
    assert stepper.lag > 30 * MS
    made.run(200 * MS)
    made.move(constant_acceleration.move(200, 1000, 50, 10).train, 1)
    made.rest()
    assert stepper.lag == 0
    counts_agree(made)


def test_a_lag_that_a_rest_has_caught_up_counts_until_its_pulses_have_left() -> None:
    made = bench(lead=60 * MS)
    made.move(constant_acceleration.move(1000, 1000, 1, 200).train, 1)
    made.run(100 * MS)
    made.turn(made.wall + 80 * MS)
    made.run(5 * MS)  # the board says where it ran dry
    stepper = made.boards.steppers["slide"]
    lag = stepper.lag
    assert lag > 20 * MS
    made.until(lambda: not made.axes["slide"].moving)
    made.run(lag + 25 * MS)
    made.move(constant_acceleration.move(1000, 1000, 1, 50).train, -1)
    made.run(3 * MS)
    assert stepper.lag == 0
    assert made.machine.axes["slide"].position < 200  # the last of them are still on their way
    assert stepper.behind(made.now) == lag
    made.rest()
    assert stepper.behind(made.now) == 0
    counts_agree(made)


def test_a_small_move_queue_is_never_overrun() -> None:
    made = bench(board={"moves": 16}, error="exact")
    kept = recorded(made)
    made.move(constant_acceleration.move(1000, 5000, 300, 1500).train, 1)
    made.rest()
    counts_agree(made)
    edges_are(made, kept["slide"], 0)
    assert made.boards.ready
