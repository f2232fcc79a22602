"""Outputs: a change comes at its tick, is held back while it can still be taken back, and corrected where it cannot."""

from dataclasses import replace
from random import Random

import pytest
from tests.generated import seeds
from tests.realtime.boards.bench import MOV, SLIDE, Bench, bench

from detent.ramps import constant_acceleration
from detent.realtime.boards.events import ShutDown, Slipped
from detent.realtime.boards.setup import OutputSetup, Pin
from detent.ticks import MS, SECOND, Ns


def changes(made: Bench, pin: str = "gpio6") -> list[tuple[int, bool]]:
    """(cell time at which the pin changed, less the lead; level), in whole us."""
    scale = made.boards.master.core.scale
    edges = [(tick, level) for tick, name, level in made.machine.edges if name == pin and tick >= scale.offset]
    return [(round(scale.time(tick) / 1000), level) for tick, level in edges]


def test_a_change_comes_a_lead_behind_its_time_with_the_step_of_that_time() -> None:
    made = bench()
    made.move(constant_acceleration.move(200, 1000, 50, 300).train, 1)
    train = made.axes["slide"].train
    assert train is not None
    made.boards.outputs["MOV"].set(True, made.now)
    made.until(lambda: not made.axes["slide"].moving)
    made.boards.outputs["MOV"].set(False, train.time_of(300))
    made.rest()
    assert changes(made) == [(0, True), (round(train.time_of(300) / 1000), False)]
    last_step, last_edge = made.machine.steps[-1][0], made.machine.edges[-1][0]
    assert abs(last_step - last_edge) <= 17  # the error of a pulse, and a tick


def test_changes_of_one_instant_come_in_order() -> None:
    made = bench()
    for level in (True, False, True):
        made.boards.outputs["MOV"].set(level, 5 * MS)
    made.run(100 * MS)
    ticks = [tick for tick, pin, _ in made.machine.edges if pin == "gpio6"][-3:]
    assert ticks[1] - ticks[0] == ticks[2] - ticks[1] == 1


def test_what_was_not_given_to_the_board_is_taken_back_without_a_trace() -> None:
    made = bench()
    out = made.boards.outputs["MOV"]
    at = made.now
    made.boards.stops["slide"].arm({"EOT": False}, at)
    out.set(True, at + 1)
    made.run(5 * MS)  # of a lead of 30: it is still here
    out.rewind(at, False)
    made.run(100 * MS)
    assert changes(made) == []
    assert out.corrections == 0


def test_what_has_left_is_corrected() -> None:
    made = bench()
    out = made.boards.outputs["MOV"]
    out.set(True, made.now + 1)
    at = made.now
    made.run(27 * MS)
    out.rewind(at, False)
    made.run(100 * MS)
    assert [level for _, level in changes(made)] == [True, False]
    assert out.corrections == 1


def test_what_nothing_can_take_back_is_given_at_once() -> None:
    """So that a host which is kept away for less than the lead is not late with it: also what a stop begins with."""
    made = bench()
    out = made.boards.outputs["MOV"]
    out.set(True, made.now)
    made.boards.stops["slide"].arm({"EOT": False}, made.now)
    made.run(3 * MS)
    assert out.level is True
    assert changes(made) == []
    out.set(False, made.now)
    made.run(3 * MS)
    assert out.level is True, "it waits: a stop may take it back"
    made.run(100 * MS)
    assert [level for _, level in changes(made)] == [True, False]


def test_a_watchdog_is_fed_without_a_time() -> None:
    """So that a host which is kept away before it writes is not late with it."""
    made = bench()
    made.boards.outputs["ENABLE"].set(True, made.now)
    made.run(100 * MS)
    before = len(made.board.log)
    made.run(3 * SECOND)
    fed = [name for _, name, _ in made.board.log[before:] if name.endswith("digital_out")]
    assert len(fed) >= 5
    assert set(fed) == {"update_digital_out"}
    assert made.machine.outputs["gpio4"] is False


def test_what_has_left_and_is_set_again_alike_stays() -> None:
    made = bench()
    out = made.boards.outputs["MOV"]
    at = made.now + 1
    out.set(True, at)
    made.run(27 * MS)
    out.rewind(at - 1, False)
    out.set(True, at)
    made.run(100 * MS)
    assert [level for _, level in changes(made)] == [True]
    assert out.corrections == 0


def test_what_is_set_otherwise_behind_a_rewind_ends_as_it_was_set() -> None:
    made = bench()
    out = made.boards.outputs["MOV"]
    at = made.now
    out.set(True, at + 1)
    out.set(False, at + 2 * MS)
    made.run(29 * MS)
    out.rewind(at, False)
    out.set(True, at + 1 * MS)
    made.run(100 * MS)
    assert changes(made)[-1][1] is True
    assert out.level is True


def test_a_late_change_is_made_at_once() -> None:
    made = bench()
    at = made.now
    made.run(80 * MS)
    made.boards.outputs["MOV"].set(True, at)
    made.run(50 * MS)
    assert made.machine.outputs["gpio6"] is True
    assert made.boards.ready


@pytest.mark.parametrize("kept_away", [40, 100])
def test_a_pulse_keeps_its_width_where_the_computer_was_away(kept_away: int) -> None:
    """At rest: what follows comes later, too; before, both edges came at once."""
    made = bench(steppers=(replace(SLIDE, unit="x"),), outputs=(replace(MOV, unit="x"),))
    at = made.now
    made.turn(made.wall + kept_away * MS)
    for n in range(3):
        made.boards.outputs["MOV"].set(n % 2 == 0, at + MS + 4 * n * MS)
    made.run(200 * MS)
    (first, _), *_ = found = changes(made)
    assert [(time - first, level) for time, level in found] == [(0, True), (4000, False), (8000, True)]
    slips = [event.by for event in made.of(Slipped)]
    assert len(slips) == (kept_away > 30)
    assert first == pytest.approx(1000 + sum(slips) / 1000, abs=2)


def test_now() -> None:
    made = bench()
    out = made.boards.outputs["MOV"]
    out.set(True, made.now + 500 * MS)
    out.now(True)
    made.run(20 * MS)
    assert made.machine.outputs["gpio6"] is True
    out.now(False)
    made.run(20 * MS)
    assert made.machine.outputs["gpio6"] is False


def test_active_low_outputs_begin_and_fall_as_they_are_set_up() -> None:
    low = OutputSetup("RDY", Pin.parse("!gpio7"), initial=True, off=False)
    made = bench(outputs=(low,))
    assert made.machine.outputs["gpio7"] is False
    made.boards.emergency_stop(made.wall)
    made.run(20 * MS)
    assert made.machine.outputs["gpio7"] is True


def test_many_changes_wait_for_room_in_the_queue() -> None:
    made = bench(board={"moves": 8})
    out = made.boards.outputs["MOV"]
    for n in range(60):
        out.set(n % 2 == 0, made.now + n * MS // 10)
    made.run(1 * SECOND)
    assert made.boards.ready
    assert len(changes(made)) == 60


@pytest.mark.parametrize("held", [0, 20 * MS, 200 * MS])
def test_what_is_late_already_cannot_be_too_late(held: Ns) -> None:
    """A time a few milliseconds from now, on a wire that takes longer, would shut the board down."""
    made = bench()
    out, at = made.boards.outputs["MOV"], made.now
    made.run(80 * MS)
    port = made.ports[0]
    send = port.send
    port.send = lambda data, wall: send(data, wall + held)  # type: ignore[method-assign]
    out.set(True, at)
    made.run(50 * MS)
    out.set(False, at)
    made.run(400 * MS)
    out.now(True)
    made.run(400 * MS)
    assert made.boards.ready
    assert not made.of(ShutDown)
    assert [level for _, level in changes(made)] == [True, False, True]


def stood(seed: int) -> None:
    """An output that changes, late or in time, on a board whose clock stands now and then (a process kept waiting)."""
    random = Random(seed)
    made = bench()
    out, level = made.boards.outputs["MOV"], False
    for _ in range(30):
        level = not level
        out.set(level, made.now - random.choice([0, 0, random.randrange(100 * MS)]))
        made.run(random.randrange(60 * MS))
        if random.random() < 0.5:
            made.ports[0].stand(random.randrange(40 * MS))
            made.run(random.randrange(5 * MS))
        if random.random() < 0.2:
            level = not level
            out.now(level)
    made.run(4 * SECOND)
    assert made.boards.ready, made.of(ShutDown)
    assert made.machine.outputs["gpio6"] is level


def test_nothing_is_said_at_once_before_the_board_has_said_that_what_was_queued_is_done() -> None:
    """`update_digital_out` while a change is queued shuts the firmware down; an estimate of its clock may be off."""
    for seed in seeds(40):
        stood(seed)


@pytest.mark.slow
def test_clocks_that_stand_shut_no_output_down_in_many_sessions() -> None:
    for seed in range(100, 500):
        stood(seed)
