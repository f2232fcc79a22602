"""Cells in which something else was under way when a stop, an edge or a switch came, each with what its page says."""

import pytest
from tests.controllers.dcb274.bench_unit import Bench

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.pins import PinSet
from detent.ticks import MS, SECOND, US, Ns
from detent.uart import Sent

UNIT = '[units.u]\nmodel = "dcb-274"\n'


def played(text: str, until: Ns = 10 * SECOND) -> Cell:
    cell = build(parse(text, "cell"), lambda file: "")
    cell.run_to(until)
    return cell


def events(cell: Cell, unit: str, kind: type) -> list:
    assert cell.recording is not None
    return [event for event in cell.recording.of(unit) if isinstance(event, kind)]


def script(at: str, lines: list[str], to: str = "u") -> str:
    return f'[[script]]\nat = "{at}"\nsend = {lines}\nto = "{to}"\n'


@pytest.mark.parametrize("stop", ["SS", "@"])
def test_a_stop_in_a_reversal_ends_at_rest_and_cancels_what_waits(stop: str) -> None:
    """Page 28: "Decelerate and cancel pending instruction"."""
    last = '[[script]]\nat = "1.05 s"\nset = { stop = 0 }\n' if stop == "SS" else script("1.05 s", ["@"])
    cell = played(
        UNIT + '[switches.stop]\ndrives = "u.SS"\n' + script("0 ms", ["K 20 20", "M 3000"])
        + script("1 s", ["M -3000", "M 1000"]) + last
    )  # fmt: skip
    status = cell.controller("u").status(cell.now)
    assert (status.state, status.pulses) == ("ready", status.position)  # all of them in plus direction
    assert events(cell, "u", MotionEnded)[-1].at < 1_200 * MS
    assert {event.direction for event in events(cell, "u", MotionStarted)} == {1}


@pytest.mark.parametrize("stop", ["SS", "@", "@ in a pending period", "@ in a program", "l 32 and a limit"])
def test_a_stop_while_home_is_looked_for_is_heeded_whatever_the_switch_does(stop: str) -> None:
    """Page 28: "After velocity deceleration, the process is terminated"."""
    bench = Bench()
    bench.do("K 50 50", "l 32", wait=20 * MS)
    if stop == "@ in a program":
        bench.do("P 0", "F 10000 0", "P", "G", wait=20 * MS)
    else:
        bench.say("F 10000 0\r")
    bench.run_to(bench.now + 300 * MS)
    if stop == "@ in a pending period":
        bench.say("+50\r")
        bench.run_to(bench.now + 10 * MS)
    at = bench.now
    match stop:
        case "SS":
            bench.pin("SS", 0)
        case "l 32 and a limit":
            bench.pin("LIMIT-B", 0)
        case _:
            bench.say("@\r")
    bench.run_to(bench.now + 20 * MS)
    bench.pin("HOME", 0)
    bench.run_to(bench.now + 5 * SECOND)
    assert {event.direction for event in bench.of(MotionStarted)} == {-1}
    assert bench.of(MotionEnded)[-1].at - at < 350 * MS
    assert bench.unit.status(bench.now).state == "ready"


def test_f_waits_for_its_current_once() -> None:
    """Page 51: "the delay is not used if the setback timeout is not timed-out"."""
    home = '[switches.home]\ndrives = "u.HOME"\naxis = "u"\nfrom = -340\nto = -300\n'
    cell = played(UNIT + home + script("0 ms", ["w 200", "F 3000 0"]))
    there, back = events(cell, "u", MotionStarted)
    assert there.train.time_of(0) - there.at == 2 * SECOND
    assert back.train.time_of(0) == back.at
    assert events(cell, "u", MotionCut)[-1].at < 2_300 * MS
    assert cell.controller("u").status(cell.now).position == -299


@pytest.mark.parametrize("stop", ["@", "SS", "ESC", "JOG1"])
def test_a_motion_that_waits_for_its_current_makes_no_step_when_it_is_stopped(stop: str) -> None:
    """Pages 28 and 51: the windings are energized, and there is nothing to decelerate."""
    bench = Bench()
    bench.do("w 50", wait=2 * SECOND)
    if stop == "JOG1":
        bench.pin("JOG1", 0)
    else:
        bench.say("M 3000\r")
    bench.run_to(bench.now + 400 * MS)
    match stop:
        case "@":
            bench.say("@\r")
        case "ESC":
            bench.say("\x1b")
        case pin:
            bench.pin(pin, 1 - bench.unit._ports.levels[pin])
    bench.run_to(bench.now + 50 * MS)
    assert bench.unit._axis.pulses == 0
    bench.pin("SS", 1)
    bench.do("M 3000", wait=20 * MS)  # the current rose 450 ms ago: the rest of w is waited for
    last = bench.of(MotionStarted)[-1]
    assert last.train.time_of(0) == bench.of(MotionStarted)[0].train.time_of(0)


def test_a_second_unit_follows_the_steps_of_the_first_in_rate_and_direction() -> None:
    """Page 45: "moving it at the same rate and direction"; page 10: direction before the edge, and held behind it."""
    text = (
        '[units.x]\nmodel = "dcb-274"\n[units.y]\nmodel = "dcb-274"\n[switches.step]\ndrives = "x.STEP"\n'
        '[switches.dir]\ndrives = "x.DIR"\nlevel = 0\n[[wires]]\nfrom = "x.P4"\nto = "y.STEP"\n'
        '[[wires]]\nfrom = "x.P5"\nto = "y.DIR"\n' + script("0 ms", ["l 2"], "x")
    )
    for pulse in range(8):
        for at, level in ((100_000 + 1000 * pulse, 0), (100_020 + 1000 * pulse, 1)):
            text += f'[[script]]\nat = "{at} us"\nset = {{ step = {level} }}\n'
        if pulse == 4:
            text += '[[script]]\nat = "104500 us"\nset = { dir = 1 }\n'
    cell = played(text, SECOND)
    for unit in "xy":
        status = cell.controller(unit).status(cell.now)
        assert (status.position, status.pulses) == (-5 + 3, 8), unit


def test_flag_8_inverts_step_and_dir_too() -> None:
    """Page 8: "l 9" inverts "all of the inputs"; STEP and DIR stand in its list."""
    bench = Bench(straps={"PLC": 1})
    bench.do("l 9", wait=20 * MS)
    for pin in ("DIR", "STEP"):
        bench.pin(pin, 0)
    for _ in range(3):
        bench.pin("STEP", 1)
        bench.run_to(bench.now + 20 * US)
        bench.pin("STEP", 0)  # reads high: the edge
        bench.run_to(bench.now + MS)
    assert bench.position == 3  # DIR reads 1
    bench.pin("DIR", 1)
    bench.pin("STEP", 1)
    bench.run_to(bench.now + 20 * US)
    bench.pin("STEP", 0)
    bench.run_to(bench.now + MS)
    assert bench.position == 2


def test_no_step_from_outside_falls_into_the_last_pulse_of_the_axis() -> None:
    """Page 10: "motion commands will conflict with these inputs"; at most 16 000 steps a second."""
    for late, moved in ((0, 0), (62_400, 0), (62_600, 1)):
        bench = Bench(encoder=True)
        bench.do("M 3000", wait=20 * MS)
        bench.do("M 0", wait=2 * SECOND)
        bench.do("+20", wait=MS)
        while (at := bench.unit.next_deadline()) is not None and bench.unit.status(bench.now).state != "ready":
            bench.run_to(at)
        before = bench.unit._axis.pulses
        bench.run_to(bench.of(MotionEnded)[-1].at + late)
        bench.pin("STEP", 0)
        bench.run_to(bench.now + MS)
        assert bench.unit._axis.pulses - before == moved, late


@pytest.mark.parametrize(("address", "base"), [(0, 0), (2048, 0), (300, 300), (128, 128)])
def test_l_tests_its_port_every_2_to_3_ms_wherever_it_stands(address: int, base: int) -> None:
    """Page 44: "The standard loop tests the condition every 2-3ms"; with 2048 it is a tight loop."""
    for late in range(0, 2600, 100):
        bench = Bench()
        bench.do(f"P {base}", f"L {address} 0", "A 8", "P", f"G {base}", wait=50 * MS)
        bench.run_to(bench.now + late * US)
        closed = bench.now
        bench.pin("P1", 0)
        bench.run_to(bench.now + SECOND)
        on = next(event for event in bench.of(PinSet) if event.pin == "P4" and event.level == 0)
        took = on.at - closed - (0 if base == 128 else 2 * MS) - 500 * US  # until A is fetched and done
        assert 0 <= took <= (0 if address == 2048 else 2_500 * US), late


def test_c_1_ends_the_readout() -> None:
    """Page 32: after C 1 "Auto Position Readout (Z) Off"; page 31: 247 to 255 are protected."""
    bench = Bench()
    bench.do("Z 1", "S", "\\ 255 7")
    assert bench.do("C 1") == "C 1 V1.10\r\n"
    before = len(bench.out)
    bench.do("+50")
    assert not [o for o in bench.out[before:] if isinstance(o, Sent) and o.char.value == 13][1:]
    assert bench.do("[ 255") == "[ 255   7\r\n"
    bench.say("\x03 ")
    bench.run_to(bench.now + SECOND)
    assert bench.unit._settings.readout == 0


@pytest.mark.parametrize("name", [0, 1, 0x40, 0x41, 0x5B, 0x7E, 0x7F, 0xFF])
@pytest.mark.parametrize("programming", [False, True])
def test_a_name_is_one_for_everybody_or_for_nobody(name: int, programming: bool) -> None:
    """Pages 23 and 57: ^N stores a name at once; what is none is refused, and changes nothing."""
    bench = Bench(name="Q")
    if programming:
        bench.do("P 0")
    bench.say("\x0e" + chr(name))
    bench.run_to(bench.now + SECOND)
    kept, called = bench.unit.memory.nv[247], bench.unit._settings.name
    assert kept == called
    assert kept == (name if name in (1, 0x41, 0x7E) else ord("Q"))
    if programming:
        assert bench.do("+ 5") == "+ 5\r\n"


def test_a_cell_that_holds_no_name_is_read_as_the_factory_has_it() -> None:
    """Page 31: 247 can be written raw."""
    for value in (0, 64, 255):
        bench = Bench(name="Q")
        bench.do(f"\\ 247 {value}")
        bench.say("\x03 ")
        bench.run_to(bench.now + SECOND)
        assert bench.do("X").endswith("n=A\r\n")


def test_go_and_ss_in_conflict_are_told_as_they_are() -> None:
    """Pages 4 and 45: flag 8 is set temporarily; `l 128` and `X` say so alike."""
    bench = Bench(straps={"PLC": 1})
    assert bench.do("l 128") == "l 128   8\r\n"
    assert ", l=8, " in bench.do("X")
    bench.do("C 0")
    assert bench.do("l 128") == "l 128   8\r\n"


@pytest.mark.parametrize("line", ["G", "+5000", "M 900", "F 900 0", "R 77"])
def test_nothing_sets_off_while_the_soft_stop_input_is_active(line: str) -> None:
    """Pages 7 and 28; a command in its execution time is stopped as well, by a contact for a moment too."""
    bench = Bench()
    bench.do("P 0", "+ 100", "P", wait=50 * MS)
    bench.pin("SS", 0)
    assert bench.do(line) == line + "#\r\n"
    bench.pin("JOG1", 0)
    bench.pin("GO", 0)
    bench.run_to(bench.now + SECOND)
    bench.pin("GO", 1)
    bench.pin("JOG1", 1)
    bench.pin("SS", 1)
    bench.say(line + "\r")
    bench.run_to(bench.now + 200 * US)
    bench.pin("SS", 0)
    bench.pin("SS", 1)
    bench.run_to(bench.now + 5 * SECOND)
    assert bench.unit._axis.pulses == 0


def test_a_held_key_does_not_undo_a_stop() -> None:
    """Page 28: abort and soft stop end everything; the contact has to open first."""
    for how in ("\x1b", "@"):
        for pin in ("GO", "JOG2"):
            bench = Bench()
            bench.do("P 0", "M 900", "L 2048 0", "P", wait=50 * MS)
            bench.pin(pin, 0)
            bench.run_to(bench.now + 500 * MS)
            bench.say(how)
            bench.run_to(bench.now + SECOND)
            at = bench.unit._axis.pulses
            bench.run_to(bench.now + SECOND)
            assert bench.unit._axis.pulses_at(bench.now) == at > 0
            bench.pin(pin, 1)
            bench.pin(pin, 0)
            bench.run_to(bench.now + SECOND)
            assert bench.unit._axis.pulses_at(bench.now) > at
