"""The firmware's count of steps has 31 bits: an axis that goes on for days passes its end, and stays known.

2^30 steps are 30 hours at 10 kHz, in one direction: a feeder, a turntable.
"""

from dataclasses import replace
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.realtime.boards.bench import SLIDE, Bench, setup, slide

from detent.ramps import constant_acceleration
from detent.realtime.boards.count import DOUBT, END, Count
from detent.realtime.boards.events import CountDiffers, CountEnds, Recovered, Stopped
from detent.realtime.boards.fake.board import FakeBoard
from detent.realtime.boards.fake.machine import MachineSwitch
from detent.realtime.boards.fake.parts import Stepper
from detent.realtime.boards.fake.port import FakePort
from detent.realtime.boards.setup import Pin
from detent.ticks import MS

MOVE = constant_acceleration.move(2000, 2000, 1, 400).train
BACK = constant_acceleration.move(2000, 2000, 1, 900).train


def after_so_many(count: int, *switches: MachineSwitch, minus: Pin | None = None) -> Bench:
    """A host whose board has counted so many steps meanwhile. The cell begins at 0."""
    steppers = (replace(SLIDE, minus=minus),)
    made = Bench([(setup(steppers=steppers), FakePort(FakeBoard(slide(*switches))))])
    for part in made.board.oids.values():
        if isinstance(part, Stepper):
            part.position = count
    axis = made.boards.steppers["slide"]
    for channel in axis._channels:
        channel.count = Count(count)
    axis._offset = -sum(channel.sign * count for channel in axis._channels)
    return made


@pytest.mark.parametrize("count", [END - 150, END, -END + 150, END - 401])
@pytest.mark.parametrize("minus", [None, Pin("gpio5")])
def test_an_axis_passes_the_end_of_the_count_and_comes_back(count: int, minus: Pin | None) -> None:
    made = after_so_many(count, minus=minus)
    for train, direction in ((MOVE, 1), (BACK, -1), (BACK, 1)):
        made.move(train, direction)
        made.rest()
        assert not made.of(CountDiffers)
        assert made.boards.steppers["slide"].counted() == made.axes["slide"].shaft


def test_steps_that_went_missing_beyond_the_end_are_told() -> None:
    made = after_so_many(END - 150)
    made.move(MOVE, 1)
    made.run(150 * MS)
    made.board.oids[0].position -= 3
    made.rest()
    [differs] = made.of(CountDiffers)
    assert (differs.shaft, differs.counted) == (400, 397)


def test_a_stop_beyond_the_end_is_where_it_is_and_the_count_goes_on_from_there() -> None:
    """Stopped, the firmware takes what it answers for its count."""
    far = DOUBT + 5000
    made = after_so_many(END + far, MachineSwitch("slide", "gpio10", 500, 1 << 30, inside=False))
    for n, place in enumerate((500, 300), 1):
        made.boards.stops["slide"].arm({"EOT": False}, made.now)
        made.move(constant_acceleration.move(2000, 2000, 1, 700).train, 1)
        made.until(lambda n=n: len(made.of(Stopped)) == n)
        axis = made.axes["slide"]
        assert made.of(Stopped)[-1].shaft == 500, place
        if axis.moving:
            axis.cut(made.now)
        made.told["slide"].clear()
        axis.shaft = 500
        made.boards.steppers["slide"].rewind(500)
        made.boards.stops["slide"].disarm()
        made.move(MOVE, -1)
        made.rest()
        assert made.boards.steppers["slide"].counted() == axis.shaft == 100
        assert not made.of(CountDiffers)
    assert not made.of(CountEnds)


def test_a_stop_at_the_very_end_is_told_as_one_that_nobody_knows() -> None:
    made = after_so_many(END - 300)
    made.move(MOVE, 1)
    made.run(210 * MS)
    made.board.shut_down("Timer too close")
    made.run(50 * MS)
    made.boards.recover(made.wall)
    made.until(lambda: bool(made.of(Recovered)))
    assert [event.stepper for event in made.of(CountEnds)] == ["slide"]


@given(st.integers(-(1 << 40), 1 << 40), st.integers(-DOUBT // 2, DOUBT // 2), st.booleans(), st.integers(0, 9))
def test_an_answer_means_what_the_firmware_counted_or_is_doubtful(
    told: int, off: int, stopped: bool, seed: int
) -> None:
    """The register as it is: a count that goes on for ever in 32 bits, of which 31 are answered."""
    random, count, true = Random(seed), Count(told), told
    base = 0  # what a stop has taken away of the count

    def answer() -> int:
        place = (true - base + END) % (4 * END)
        return (place if place <= 2 * END else 4 * END - place) - END

    for _ in range(5):
        step = random.randrange(-(1 << 31), 1 << 31)
        count, true = count.sent(step), true + step
        true += off
        if count.doubtful(answer()):
            return
        assert count.whole(answer()) == true
        asked = answer()
        count = count.found(asked, stopped=stopped)
        assert count.told == true
        if stopped:
            base = true - asked
