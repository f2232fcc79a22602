"""A cell behind its pins, case by case: outputs, inputs, holds, held replies, memory, slips, failures, recovery."""

import re
from random import Random
from typing import Any

import pytest
from tests.generated import seeds
from tests.realtime.boards.driven_bench import Bench, pulses

from detent.realtime.boards.board import State
from detent.realtime.boards.events import Stopped
from detent.realtime.boards.fake.board import FakeBoard
from detent.realtime.boards.states import Severity, Standing
from detent.ticks import MS, SECOND, US, Ns

CELL = """
[units.x]
model = "gs-c200s"
straps = { CHS = "low" }
[boards.b]
serial = "fake"
lead = "30 ms"
[hardware.x]
board = "b"
step = "!gpio2"
dir = "gpio3"
enable = "!gpio4"
outputs = { MOV = "gpio6", RDY = "!gpio7", UO1 = "gpio8" }
inputs = { EOT = "^gpio10", HOME = "^gpio11", ENABLE = "^gpio12", UI1 = "^!gpio13", UI2 = "^gpio14" }
"""
LEAD = 30 * MS


def levels(bench: Bench, pin: str, board: str = "b") -> list[tuple[Ns, bool]]:
    """What a pin of the board did, by cell time less the lead."""
    port = bench.ports[board]
    port.run_to(bench.wall)
    scale = bench.boards.boards[board].core.scale
    return [(scale.time(tick), level) for tick, name, level in bench.machines[board].edges if name == pin]


def weights(bench: Bench) -> list[Severity]:
    return [news.severity for news in bench.news]


def test_outputs_change_with_the_pulses_they_belong_to() -> None:
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        bench.type("x", "A1")
        bench.run(50 * MS)
        bench.type("x", "+40")
        bench.rest()
        motion = pulses(bench.driven.ledgers[0].motions.since(0), bench.cell.now)
        (begun, high), (over, low) = levels(bench, "gpio6")[-2:]
        assert (high, low) == (True, False)
        assert bench.cell.recording is not None
        assert abs(over - motion[-1][0]) <= 2 * US, "MOV falls with the last step"
        assert begun < motion[0][0]
        assert [level for _, level in levels(bench, "gpio4")][-1] is False, "the driver is enabled, active low"
        assert levels(bench, "gpio8")[-1][1] is True
        # RDY is active low on this board
        assert [level for _, level in levels(bench, "gpio7")][-2:] == [True, False]


@pytest.mark.parametrize("pause", [1, 118, 122, 400])
@pytest.mark.parametrize("ahead", [1, 119])
def test_behind_a_slip_outputs_and_steps_keep_their_order_and_distance(pause: int, ahead: int) -> None:
    """A brake that is let go before a motion is let go before it on the pins, too, and by as much."""
    with Bench(CELL) as bench:
        bench.driven._forget = lambda: None  # type: ignore[method-assign]
        bench.run(100 * MS)
        bench.type("x", "+150")
        bench.run(60 * MS)
        bench.stall(120 * MS)
        while bench.driven.axes()[0].moving:
            bench.run(100 * US)
        assert bench.driven.axes()[0].slips == 1
        bench.run(pause * MS)
        bench.type("x", "A1")
        bench.run(ahead * MS)
        bench.type("x", "+10")
        bench.run(200 * MS)
        bench.rest()
        assert bench.driven.axes()[0].slips == 1
        [ledger] = bench.driven.ledgers
        [changed] = [at for at, level in bench.driven.outgoing.outputs[0, "UO1"].levels.since(0) if level]
        begun = pulses(ledger.motions.since(0), bench.cell.now)[150][0]
        [(released, _)] = [pair for pair in levels(bench, "gpio8") if pair[1]][-1:]
        scale = bench.boards.boards["b"].core.scale
        first = scale.time(bench.edges("x")[150][0])
        assert abs((first - released) - (begun - changed)) < 60 * US


def test_outputs_come_up_as_the_cell_has_them_without_a_glitch() -> None:
    with Bench(CELL) as bench:
        bench.run(200 * MS)
        assert [level for _, level in levels(bench, "gpio7")] == [False], "RDY, active low"
        assert [level for _, level in levels(bench, "gpio6")] == [False]
        assert [level for _, level in levels(bench, "gpio4")] == [True, False], "switched on, active low"


@pytest.mark.parametrize("begins", range(90, 140, 5))
def test_an_output_that_is_late_behind_steps_in_time_is_told(begins: int) -> None:
    """It was not given to the board with them, as a stop might have taken it back; a slip moves both."""
    text = CELL.replace("outputs = { MOV", 'outputs = { RAMP = "gpio9", MOV')
    with Bench(text) as bench:
        bench.keep()
        bench.run(100 * MS)
        bench.type("x", "+400")
        bench.run(begins * MS)
        bench.stall(18 * MS)
        bench.rest()
        out = bench.driven.outgoing.outputs[0, "RAMP"]
        scale = bench.boards.boards["b"].core.scale
        found = [(scale.time(tick), level) for tick, pin, level in bench.machines["b"].edges if pin == "gpio9"]
        late = [came - at for (came, _), (at, _) in zip(found[1:], out.levels.since(2), strict=True)]
        told = [news.text for news in bench.news if "x.RAMP changed" in news.text]
        assert bench.driven.axes()[0].slips == 0
        assert sum(by > MS for by in late) == len(told)


def test_inputs_are_read_before_the_unit_is_switched_on() -> None:
    """With REC low the module homes at power-on ("Recall"): both switches closed, it is done without a step."""
    text = CELL.replace('CHS = "low"', 'CHS = "low", REC = "low"')
    with Bench(text, switches={"x.EOT": ("x", -5, 5), "x.HOME": ("x", -5, 5)}) as bench:
        bench.run(500 * MS)
        assert bench.edges("x") == []
        assert bench.cell.controller("x").status(bench.cell.now).state == "ready"


def test_an_input_that_stops_nothing_reaches_the_cell_when_it_arrives() -> None:
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        bench.press("x.UI1", 0)
        bench.run(50 * MS)
        bench.type("x", "V2")
        bench.run(100 * MS)
        assert bench.said("x") == "V60\r"
        bench.press("x.UI1", 1)
        bench.run(50 * MS)
        bench.type("x", "V2")
        bench.run(100 * MS)
        assert bench.said("x") == "V60\rV70\r"


def test_a_gentle_stop_keeps_its_ramp() -> None:
    """g+1 stops through the ramp when UI1 goes low: nothing is cut, the reaction is a lead and some milliseconds."""
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        bench.press("x.UI1", 1)
        for line in ("S20", "T60", "R30", "g+1"):
            bench.type("x", line)
            bench.run(20 * MS)
        bench.run(400 * MS)
        assert "x.UI1" not in bench.driven.axes()[0].armed
        bench.press("x.UI1", 0)
        bench.rest()
        assert bench.driven.rollback.rewinds == 0
        assert bench.news == []
        assert bench.position("x") == bench.driven.axes()[0].shaft > 100


def test_enable_holds_the_pulse_in_the_firmware() -> None:
    """ENABLE low holds the next pulse until it is high again (pin 24): no step comes between, and none is lost."""
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        bench.type("x", "S50")
        bench.run(20 * MS)
        bench.type("x", "+300")
        bench.run(203 * MS)
        low = bench.boards.cell_at(bench.wall) - LEAD
        bench.press("x.ENABLE", 0)
        bench.run(300 * MS)
        assert bench.driven.rollback.rewinds == 1
        high = bench.boards.cell_at(bench.wall) - LEAD
        bench.press("x.ENABLE", 1)
        bench.run(20 * MS)
        bench.rest()
        scale = bench.boards.boards["b"].core.scale
        times = [scale.time(tick) for tick, _ in bench.edges("x")]
        assert len(times) == 300
        assert not [at for at in times if low + 200 * US < at < high]
        assert bench.news == []


def test_replies_wait_until_nothing_can_change_them() -> None:
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        bench.type("x", "V1")
        bench.run(200 * MS)
        assert bench.said("x") == "V+0\r"
        for board_ns, at, _ in bench.heard[0]:
            held = board_ns - bench.driven.outgoing.clock.offset - at
            assert LEAD + 4 * MS <= held <= LEAD + 6 * MS


def test_replies_at_once_for_hosts_that_do_not_wait() -> None:
    with Bench(CELL.replace('lead = "30 ms"', 'lead = "30 ms"\nreplies = "at once"')) as bench:
        bench.run(100 * MS)
        bench.type("x", "V1")
        bench.run(200 * MS)
        for board_ns, at, _ in bench.heard[0]:
            assert 0 <= board_ns - bench.driven.outgoing.clock.offset - at <= MS


DCB = """
[units.x]
model = "dcb-274"
[boards.b]
serial = "fake"
[hardware.x]
board = "b"
step = "gpio2"
dir = "gpio3"
inputs = { LIMIT-A = "^gpio10", LIMIT-B = "^gpio11", HOME = "^gpio12" }
"""


def positions(bench: Bench) -> list[int]:
    """What a host reads that asks all the time, while the axis runs into a limit at 200."""
    bench.run(100 * MS)
    bench.type("x", " ")
    bench.run(200 * MS)
    bench.type("x", "M 2000")
    for _ in range(90):
        bench.run(7 * MS)
        bench.send("x", b"Z 0\r")
    bench.run(200 * MS)
    assert bench.driven.rollback.rewinds == 1
    assert max(place for _, place in bench.edges("x")) == 200
    words = [word.split() for word in bench.said("x").split("\n")]
    return [int(word[-1]) for word in words if word[:2] == ["Z", "0"] and len(word) == 3]


def test_what_a_host_heard_too_early_is_told() -> None:
    """A position that a stop takes back was read within the lead: with replies at once it has escaped."""
    text = DCB.replace('serial = "fake"', 'serial = "fake"\nreplies = "at once"')
    with Bench(text, switches={"x.LIMIT-A": ("x", 200, 10**6)}) as bench:
        assert max(positions(bench)) > 200
        assert bench.driven.rollback.escaped > 0
        assert any("took it back" in news.text for news in bench.news)


def test_no_held_reply_contradicts() -> None:
    with Bench(DCB, switches={"x.LIMIT-A": ("x", 200, 10**6)}) as bench:
        read = positions(bench)
        assert read == sorted(read)
        assert read[-1] == 200
        assert bench.driven.rollback.escaped == 0
        assert bench.news == []


def test_memory_is_written_once_and_only_when_it_is_certain() -> None:
    written: list[tuple[str, bytes]] = []

    def store(unit: str, image: bytes) -> bool:
        written.append((unit, image))
        return True

    with Bench(DCB, switches={"x.LIMIT-A": ("x", 60, 10**6)}, store=store) as bench:
        bench.run(100 * MS)
        bench.type("x", "M 400")
        saved = False
        for _ in range(400):
            bench.run(1 * MS)
            if bench.position("x") >= 55 and not saved:
                saved = True
                before = len(written)
                bench.type("x", "S")  # within the lead of the limit
        bench.rest()
        assert bench.driven.rollback.rewinds == 1
        assert saved
        assert len(written) == before + 1
        assert written[-1] == ("x", bench.cell.controller("x").kept_memory())
        assert bench.position("x") == 60


def test_a_stalled_computer_slips_once_and_loses_nothing() -> None:
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        bench.type("x", "S50")
        bench.run(20 * MS)
        bench.type("x", "+400")
        bench.run(300 * MS)
        bench.stall(60 * MS)
        bench.rest()
        assert bench.driven.ledgers[0].stepper.slips == 1
        assert weights(bench) == [Severity.WARNING]
        assert "slipped by" in bench.news[0].text
        assert [place for _, place in bench.edges("x")] == list(range(1, 401))
        assert bench.boards.boards["b"].state.value == "ready"
        assert bench.driven.axes()[0].shaft == 400


def test_an_emergency_stop_stands_until_recover_and_goes_on_without_configuring() -> None:
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        bench.type("x", "S50")
        bench.run(20 * MS)
        bench.type("x", "+400")
        bench.run(300 * MS)
        bench.driven.stop()
        bench.run(100 * MS)
        stopped = bench.position("x")
        state = bench.driven.axes()[0]
        assert state.standing is Standing.FAULT
        assert not state.known
        assert weights(bench) == [Severity.FAULT]
        assert levels(bench, "gpio4")[-1][1] is True, "the driver is off"
        bench.type("x", "+10")  # the controller takes it, the axis does not move
        bench.run(200 * MS)
        assert bench.position("x") == stopped
        resets = bench.ports["b"].board.resets
        bench.driven.recover()
        bench.run(300 * MS)
        state = bench.driven.axes()[0]
        assert state.standing is Standing.DRIVEN
        assert state.shaft == stopped
        assert bench.ports["b"].board.resets == resets
        assert "may have lost steps" in bench.news[-1].text
        bench.type("x", "V1")
        bench.run(100 * MS)
        assert bench.said("x").endswith(f"V{stopped:+d}\r")
        bench.type("x", "-7")
        bench.rest()
        assert bench.position("x") == stopped - 7 == bench.driven.axes()[0].shaft
        assert levels(bench, "gpio4")[-1][1] is False


@pytest.mark.parametrize("end", ["a switch", "a late computer"])
@pytest.mark.parametrize("befallen", ["stopped", "unplugged", "restarted"])
def test_a_driver_stays_switched_on_behind_a_recovery(befallen: str, end: str) -> None:
    """What takes the cell back, or makes it late, leaves outputs as they are: a motor that is let go loses steps."""
    with Bench(CELL, switches={"x.EOT": ("x", 200, 10**6), "x.HOME": ("x", -(10**6), 150)}) as bench:
        bench.run(100 * MS)
        bench.type("x", "+50")
        bench.rest()
        if befallen == "stopped":
            bench.driven.stop()
        else:
            bench.ports["b"].unplugged = True
        bench.run(500 * MS)
        if befallen == "restarted":
            bench.ports["b"].board.clear()
        bench.come_back()
        bench.run(2 * SECOND)
        bench.check_outputs()
        begun = bench.wall
        bench.type("x", "H+" if end == "a switch" else "+400")
        bench.run(100 * MS)
        if end == "a late computer":
            bench.stall(100 * MS)
        bench.rest()
        assert bench.driven.axes()[0].stops or bench.driven.axes()[0].slips
        bench.check_outputs()
        scale = bench.boards.boards["b"].core.scale
        assert [level for at, level in levels(bench, "gpio4") if at > scale.time(bench.ports["b"].tick_at(begun))] == []


def test_a_board_that_shuts_down_by_itself_is_told_and_recovered() -> None:
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        bench.type("x", "+200")
        bench.run(300 * MS)
        bench.ports["b"].run_to(bench.wall)
        bench.ports["b"].board.stall(bench.ports["b"].board.frequency // 2)
        bench.run(900 * MS)
        assert bench.driven.axes()[0].standing is Standing.FAULT
        assert "board b has shut down" in bench.driven.axes()[0].why
        bench.driven.recover()
        bench.run(500 * MS)
        assert bench.driven.axes()[0].standing is Standing.DRIVEN
        assert bench.driven.axes()[0].shaft == bench.position("x")


def test_an_unplugged_board_ends_within_the_lead_and_comes_back() -> None:
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        bench.type("x", "S50")
        bench.run(20 * MS)
        bench.type("x", "+400")
        bench.run(300 * MS)
        before = bench.position("x")
        bench.ports["b"].unplugged = True
        bench.run(500 * MS)
        bench.ports["b"].run_to(bench.wall)
        after = bench.position("x")
        assert before < after <= before + 1000 * (LEAD + 5 * MS) // SECOND + 1
        state = bench.driven.axes()[0]
        assert state.standing is Standing.FAULT
        assert "board b is gone" in state.why
        assert not state.known
        assert after <= state.shaft <= after + 4, "what was sent was carried out, but for the last batch"
        bench.driven.recover()
        bench.run(300 * MS)
        assert bench.driven.axes()[0].standing is Standing.FAULT, "it is not there yet"
        bench.ports["b"].unplugged = False
        bench.run(3 * SECOND)
        assert bench.driven.axes()[0].standing is Standing.DRIVEN
        bench.type("x", "+5")
        bench.rest()
        assert bench.position("x") == bench.driven.axes()[0].shaft


def test_a_board_that_was_restarted_does_not_know_where_the_motor_is() -> None:
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        bench.type("x", "+20")
        bench.rest()
        bench.ports["b"].unplugged = True
        bench.run(500 * MS)
        bench.ports["b"].board.clear()
        bench.ports["b"].unplugged = False
        bench.driven.recover()
        bench.run(5 * SECOND)
        state = bench.driven.axes()[0]
        assert state.standing is Standing.DRIVEN
        assert not state.known
        assert any("nobody knows where the motor stands: send it home" in news.text for news in bench.news)
        bench.type("x", "+5")
        bench.rest()
        assert bench.driven.axes()[0].shaft == 25


@pytest.mark.parametrize("away", [True, False])
@pytest.mark.parametrize("after", [0, 2, 5, 10, 20, 50, 200, 600, 800])
def test_an_emergency_stop_while_a_board_comes_back_stands_until_the_next_recover(after: int, away: bool) -> None:
    """Whatever its board is about: not there yet, connecting, being configured, ready."""
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        bench.type("x", "+400")
        bench.run(300 * MS)
        if away:
            bench.ports["b"].unplugged = True
        else:
            bench.driven.stop()
        bench.run(100 * MS)
        bench.driven.recover()
        bench.run(after * MS // 2)
        bench.ports["b"].unplugged = False
        bench.run(after * MS // 2)
        bench.driven.stop()
        stopped = bench.position("x")
        bench.run(3 * SECOND)
        bench.type("x", "+10")
        bench.run(200 * MS)
        assert bench.driven.axes()[0].standing is Standing.FAULT
        assert bench.boards.master.state is not State.READY
        assert bench.position("x") == stopped
        bench.driven.recover()
        bench.run(3 * SECOND)
        assert bench.driven.axes()[0].standing is Standing.DRIVEN
        bench.type("x", "-7")
        bench.rest()
        assert bench.position("x") == bench.driven.axes()[0].shaft == stopped - 7


@pytest.mark.parametrize(
    ("back", "why"),
    [
        ({"spoil": lambda data, to_board: []}, r"boards\.b\.serial: it does not answer"),
        ({"pins": 8}, r"hardware\.x\.outputs\.UO1: .* has no pin gpio8;"),
        ({"leave_out": ("queue_digital_out",)}, r"boards\.b\.serial: .* has no queue_digital_out;"),
    ],
)
def test_a_recovery_that_comes_to_nothing_is_told(back: dict[str, Any], why: str) -> None:
    """Another board is at its address now, or something that is none; behind the next one it goes on."""
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        port = bench.ports["b"]
        board = port.board
        port.unplugged = True
        bench.run(500 * MS)
        board.clear()
        port.unplugged = False
        port.spoil = back.pop("spoil", None)
        port.board = FakeBoard(**back, first_tick=board.now, reset="config_reset") if back else board
        bench.driven.recover()
        bench.run(8 * SECOND)
        assert weights(bench) == [Severity.FAULT, Severity.FAULT]
        assert re.search(rf"^x still stands: cell\.toml: {why}.*; mend that, then recover$", bench.news[-1].text)
        assert re.search(why, bench.driven.axes()[0].why)
        port.board, port.spoil = board, None
        bench.driven.recover()
        bench.run(5 * SECOND)
        assert bench.driven.axes()[0].standing is Standing.DRIVEN


def test_where_a_motor_stands_is_known_again_when_a_switch_has_stopped_it_and_not_before() -> None:
    switches = {"x.EOT": ("x", 60, 10**6), "x.HOME": ("x", -(10**6), 40)}
    with Bench(CELL, switches=switches) as bench:
        bench.run(100 * MS)
        bench.ports["b"].unplugged = True
        bench.run(500 * MS)
        bench.ports["b"].board.clear()
        bench.ports["b"].unplugged = False
        bench.driven.recover()
        bench.run(5 * SECOND)
        bench.driven.stop()
        bench.run(100 * MS)
        bench.driven.recover()
        bench.run(SECOND)
        state = bench.driven.axes()[0]
        assert (state.standing, state.known) == (Standing.DRIVEN, False)
        assert "since the restart nobody knows where the motor stands" in bench.news[-1].text
        bench.type("x", "+50")
        bench.rest()
        assert not bench.driven.axes()[0].known
        bench.type("x", "H+")
        bench.run(500 * MS)
        bench.rest()
        state = bench.driven.axes()[0]
        assert state.stops == 2
        assert state.known


def test_a_count_that_differs_is_a_fault() -> None:
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        bench.type("x", "+20")
        bench.run(100 * MS)
        stepper = next(part for part in bench.ports["b"].board.oids.values() if hasattr(part, "counting_up"))
        stepper.position -= 1
        bench.rest()
        state = bench.driven.axes()[0]
        assert state.standing is Standing.FAULT
        assert "the board has counted 19 where the cell has 20" in state.why
        assert state.shaft == 19
        bench.driven.recover()
        bench.run(200 * MS)
        assert bench.driven.axes()[0].standing is Standing.DRIVEN


@pytest.mark.parametrize("enable", ['enable = "!gpio4"', ""])
def test_a_host_that_dies_leaves_a_motor_that_stands_and_outputs_at_rest(enable: str) -> None:
    """Without a driver to let go, too: a relay that UO1 holds is not held for ever."""
    with Bench(CELL.replace('enable = "!gpio4"', enable)) as bench:
        bench.run(100 * MS)
        bench.type("x", "A1")
        bench.run(20 * MS)
        bench.type("x", "S50")
        bench.run(20 * MS)
        bench.type("x", "+4000")
        bench.run(300 * MS)
        before = bench.position("x")
        bench.stall(5 * SECOND)  # it never comes back
        port = bench.ports["b"]
        port.run_to(bench.wall)
        assert bench.position("x") <= before + 1000 * (LEAD + 5 * MS) // SECOND + 1
        assert not enable or levels(bench, "gpio4")[-1][1] is True, "the watchdog has let the driver go"
        assert [levels(bench, pin)[-1][1] for pin in ("gpio6", "gpio7", "gpio8")] == [False, False, False]
        assert port.board.reason is not None


@pytest.mark.parametrize("power", [False, True])
def test_closing_switches_the_drivers_off(power: bool) -> None:
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        if power:
            bench.power("x", False)
            bench.run(100 * MS)
            assert levels(bench, "gpio4")[-1][1] is True
        bench.driven.close()
        bench.ports["b"].run_to(bench.wall + SECOND)
        assert bench.machines["b"].outputs["gpio4"] is True


def holds(seed: int) -> None:
    """A random move with ENABLE, a limit or both pressed and let go at random times."""
    random = Random(seed)
    lead = random.choice([4, 8, 15, 30, 50])
    speed = random.choice([2, 10, 40, 100, 400])
    text = CELL.replace('lead = "30 ms"', f'lead = "{lead} ms"')
    with Bench(text, jitter=lambda: random.randrange(300 * US)) as bench:
        bench.driven._forget = lambda: None  # type: ignore[method-assign]
        bench.run(100 * MS)
        for line in (f"S{speed}", "T500", f"R{random.choice([1, 20, 200])}"):
            bench.type("x", line)
            bench.run(15 * MS)
        steps = random.randrange(5, 40 * speed)
        bench.type("x", f"{random.choice('+-')}{min(steps, 4000)}")
        low: list[tuple[Ns, Ns]] = []
        for _ in range(random.randrange(1, 5)):
            bench.run(random.randrange(1, 300 * MS))
            bench.press("x.ENABLE", 0)
            begin = bench.wall
            bench.run(random.choice([100 * US, 3 * MS, 20 * MS, 200 * MS]) + random.randrange(MS))
            bench.press("x.ENABLE", 1)
            low.append((begin, bench.wall))
            if random.random() < 0.2:
                bench.type("x", random.choice("KZ"))
        bench.run(50 * MS)
        bench.rest()
        state = bench.driven.axes()[0]
        assert not [news for news in bench.news if news.severity is not Severity.NOTE], bench.news
        told = pulses(bench.driven.ledgers[0].motions.since(0), bench.cell.now)
        edges = bench.edges("x")
        assert [place for _, place in edges] == [place for _, place in told]
        assert bench.position("x") == state.shaft
        port = bench.ports["b"]

        for begin, end in low:
            walls = [port.wall_at(tick) for tick, _ in edges]
            assert not [at for at in walls if begin + 150 * US < at < end], "no step while it is held"


def test_holds_at_any_time_lose_no_step() -> None:
    for seed in seeds(12):
        holds(seed)


@pytest.mark.slow
def test_many_holds_lose_no_step() -> None:
    for seed in range(100, 300):
        holds(seed)


def test_a_cell_that_cannot_go_on_stops_its_boards() -> None:
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        bench.type("x", "+2000")
        bench.run(300 * MS)
        bench.driven.abandon("the cell has stopped: an oscillation")
        bench.run(200 * MS)
        assert bench.boards.boards["b"].state.value == "shut down"
        assert bench.driven.axes()[0].why == "the cell has stopped: an oscillation"
        place = bench.position("x")
        bench.run(1 * SECOND)
        assert bench.position("x") == place


def test_an_input_that_gates_single_pulses_is_refused_when_it_shows() -> None:
    with Bench(CELL, switches={"x.ENABLE": ("x", 0, 10**6)}) as bench:
        bench.run(100 * MS)
        bench.type("x", "+50")
        for _ in range(40):  # a detector outside: high for one pulse at a time
            bench.run(60 * MS)
            bench.press("x.ENABLE", 1)
            bench.run(1 * MS)
        bench.rest()
        state = bench.driven.axes()[0]
        assert state.standing is Standing.FAULT
        assert "x.ENABLE lets every single pulse through" in state.why
        assert state.shaft == bench.position("x") < 50


def test_a_stop_longer_ago_than_is_kept_is_a_fault_where_the_motor_stands() -> None:
    with Bench(DCB, switches={"x.LIMIT-A": ("x", 200, 10**6)}) as bench:
        bench.run(100 * MS)
        bench.type("x", " ")
        bench.run(200 * MS)
        bench.type("x", "M 2000")
        while bench.position("x") < 195:
            bench.run(1 * MS)
        bench.driven.outgoing.past.moments.clear()
        bench.run(500 * MS)
        bench.rest()
        state = bench.driven.axes()[0]
        assert bench.position("x") == 200 == state.shaft
        assert max(place for _, place in bench.edges("x")) == 200


def test_an_axis_that_is_held_is_told_where_its_motor_stands() -> None:
    """Steps that had left when a second stop was told: the counter has them, and what is left of the move comes."""
    with Bench(CELL) as bench:
        bench.run(100 * MS)
        bench.type("x", "+500")
        bench.run(300 * MS)
        bench.press("x.ENABLE", 0)
        bench.run(300 * MS)
        [ledger] = bench.driven.ledgers
        here = bench.position("x")
        assert ledger.motion is None
        assert 0 < here == ledger.shaft_at(bench.cell.now) < 500
        stop = Stopped("b", "x", "x.ENABLE", False, bench.cell.now, bench.cell.now, here + 3, False)
        bench.driven.rollback.stopped_too(ledger, stop)
        assert bench.driven.axes()[0].shaft == here + 3
        assert bench.cell.controller("x").status(bench.cell.now).position == here + 3
        bench.press("x.ENABLE", 1)
        bench.rest()
        state = bench.driven.axes()[0]  # no such steps had left in truth: the board's count says so
        assert state.why == "the board has counted 500 where the cell has 503"
        assert (state.shaft, bench.position("x")) == (500, 500)


def test_a_stop_before_the_first_instant_of_a_cell_is_one_that_takes_it_back() -> None:
    """A board that gets everything late by more than the cell is old tells such times."""
    with Bench(CELL) as bench:
        [ledger] = bench.driven.ledgers
        assert not bench.driven.rollback._stands(ledger, -23 * MS)
