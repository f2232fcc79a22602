"""The currents of driven motors: half at rest, and what becomes of an axis whose driver fails."""

import pytest
from tests.realtime.boards.driven_bench import Bench
from tests.realtime.boards.test_driven import CELL, DCB, LEAD, levels

from detent.realtime.boards.events import DriverFault
from detent.realtime.boards.registers import CHOPCONF
from detent.realtime.boards.states import Standing
from detent.ticks import MS, SECOND, US

HALF = 'driver = { kind = "plain", half = "gpio4" }'
GENSTEPPER = f"""
[units.x]
model = "bs0610"
[boards.b]
serial = "fake"
lead = "60 ms"
[hardware.x.X]
board = "b"
step = "gpio2"
dir = "gpio3"
unwired = ["LX-", "LX+"]
{HALF}
[hardware.x.Y]
board = "b"
step = "gpio5"
dir = "gpio6"
unwired = ["LY-", "LY+"]
"""


def test_a_plain_driver_is_not_left_with_all_its_current_when_the_host_dies() -> None:
    text = CELL.replace('enable = "!gpio4"', 'driver = { kind = "plain", half = "gpio9" }')
    with Bench(text) as bench:
        bench.run(100 * MS)
        bench.type("x", "+4000")
        bench.run(300 * MS)
        assert levels(bench, "gpio9")[-1][1] is False
        bench.stall(5 * SECOND)
        bench.ports["b"].run_to(bench.wall)
        assert levels(bench, "gpio9")[-1][1] is True


def test_a_driver_that_does_not_answer_is_a_fault_of_its_axis() -> None:
    """A DCB-274 commands amperes; the chip that should take them is not there."""
    text = DCB + 'driver = { kind = "tmc2209", uart = "gpio20", sense = 0.05 }\n'
    with Bench(text) as bench:
        bench.run(3 * SECOND)
        state = bench.driven.axes()[0]
        assert state.standing is Standing.FAULT
        assert "its driver: " in state.why


def test_a_plain_driver_gets_half_of_its_current_at_rest() -> None:
    text = CELL.replace('enable = "!gpio4"', 'enable = "!gpio4"\ndriver = { kind = "plain", half = "gpio20" }')
    with Bench(text) as bench:
        bench.run(300 * MS)
        bench.type("x", "+100")
        bench.rest()
        (full, first), (half, second) = levels(bench, "gpio20")[-2:]
        assert (first, second) == (False, True)
        edges = [bench.boards.boards["b"].core.scale.time(tick) for tick, _ in bench.edges("x")]
        assert full < edges[0]
        assert half > edges[-1]


def test_a_plain_driver_has_all_its_current_in_a_motion_that_follows_a_recovery_at_once() -> None:
    """The board fell to half of it, in a motion; nobody says anything of the current before the next one."""
    text = CELL.replace('enable = "!gpio4"', 'enable = "!gpio4"\ndriver = { kind = "plain", half = "gpio20" }')
    with Bench(text.replace('"30 ms"', '"60 ms"')) as bench:
        bench.run(300 * MS)
        bench.type("x", "+400")
        bench.run(300 * MS)
        bench.driven.stop()
        bench.driven.recover()
        while bench.driven.axes()[0].standing is not Standing.DRIVEN:
            bench.run(100 * US)
        bench.type("x", "+400")
        bench.run(300 * MS)
        assert bench.driven.axes()[0].moving
        assert [level for _, level in levels(bench, "gpio20")[-2:]] == [True, False]


def test_a_driver_that_fails_in_mid_move_stops_its_axis() -> None:
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        bench.driven.ledgers[0].what = bench.driven.ledgers[0].what._replace(driver="x.driver")
        bench.type("x", "g-")
        bench.run(500 * MS)
        before = bench.position("x")
        bench.boards.master.core.events.append(DriverFault("b", "x.driver", "it is too hot"))
        bench.run(1 * SECOND)
        after = bench.position("x")
        assert before - 1000 * (LEAD + 5 * MS) // SECOND <= after <= before
        state = bench.driven.axes()[0]
        assert state.standing is Standing.FAULT
        assert state.shaft == after
        assert "too hot" in state.why


@pytest.mark.parametrize("pause", [0, 1, 9, 100])
@pytest.mark.parametrize("lead", [5, 30, 60])
def test_microsteps_change_between_two_motions(lead: int, pause: int) -> None:
    """H of a DCB-274, from a host that waits for nothing: no step has those of the other motion."""
    text = DCB.replace('serial = "fake"', f'serial = "fake"\nlead = "{lead} ms"')
    with Bench(text + 'driver = { kind = "tmc2209", uart = "gpio20", sense = 0.05 }\n', chips=True) as bench:
        bench.run(100 * MS)
        bench.type("x", " ")
        bench.run(300 * MS)
        moved(bench, "+200")
        bench.type("x", "H 3")
        bench.type("x", "Y 10 20")
        bench.run(pause * MS)
        moved(bench, "+50")
        bench.rest()
        chip = bench.ports["b"].board.chips["gpio20"][0]
        microsteps = [(tick, value) for tick, register, value in chip.log if register == CHOPCONF]
        (_, before), (tick, now) = microsteps[-2:]
        assert (before >> 24 & 15, now >> 24 & 15) == (6, 8)
        steps = [at for at, _ in bench.edges("x")]
        assert steps[199] < tick < steps[200]
        state = bench.driven.axes()[0]
        assert state.slips == 0
        assert state.shaft == bench.position("x") == 250


def moved(bench: Bench, line: str) -> None:
    """A motion has begun and ended in the cell; its last steps have yet to leave."""
    bench.type("x", line)
    for moving in (True, False):
        while bench.driven.axes()[0].moving is not moving:
            bench.run(100 * US)


def test_a_motor_that_ends_its_move_has_all_its_current_to_the_last_step() -> None:
    """A GenStepper lets its motors have less at rest: here a lead later, and later still behind a slip."""
    for stall in (0, 100 * MS):
        with Bench(GENSTEPPER) as bench:
            bench.run(300 * MS)
            bench.send("x", b"X300G")
            bench.run(250 * MS)
            bench.stall(stall)
            bench.run(50 * MS)
            bench.rest()
            bench.run(500 * MS)
            steps = bench.edges("x.X")
            edges = [(tick, level) for tick, pin, level in bench.machines["b"].edges if pin == "gpio4"]
            assert len(steps) == 300
            assert [level for _, level in edges[-2:]] == [False, True]
            assert edges[-2][0] < steps[0][0]
            assert steps[-1][0] < edges[-1][0]
            assert bool(bench.driven.axes()[0].slips) is bool(stall)
