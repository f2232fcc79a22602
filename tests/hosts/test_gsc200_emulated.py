"""The driver of the GS-C200 on emulated modules, in virtual time, with characters that take their time at 9600 baud."""

import pytest
from tests.hosts.modules import FaultyPort, cell

from detent.cell.cell import Cell
from detent.cell.host import HostPort
from detent.hosts.axis import Speeds
from detent.hosts.errors import Busy, DriverError, MotionFailed, NoAnswer, Refused
from detent.hosts.gsc200 import BlockingGsC200, Feedback, GsC200, UserPins

MODELS = ("gs-c200", "gs-c200s")
SWITCHES = """
[switches.end]
drives = "module.EOT"
axis = "module"
to = -2000
[switches.zero]
drives = "module.HOME"
axis = "module"
from = -1500
"""


def module(model: str, more: str = "") -> tuple[Cell, BlockingGsC200]:
    made = cell(f'[units.module]\nmodel = "{model}"\n{more}')
    return made, BlockingGsC200(GsC200(model), HostPort(made))


@pytest.mark.parametrize("model", MODELS)
def test_every_command_of_both_models(model: str) -> None:
    made, unit = module(model)
    signed = model == "gs-c200s"
    assert unit.feedback() == Feedback(busy=False)
    unit.activate(1)
    unit.activate(3)
    unit.clear(1)
    assert unit.pins() == UserPins((True, True, True), (False, False, True))
    unit.set_start_stop(200)
    unit.set_top(2000)
    unit.set_ramp(20)
    unit.go_to(300)
    assert unit.moving()
    unit.wait(60)
    unit.move(-100)
    unit.wait(60)
    assert unit.position() == 200
    unit.delay(0.5)
    assert unit.moving()
    unit.wait(60)
    unit.wait_for(2)  # an open input is one: it is passed at once
    unit.wait(60)
    unit.go(1)
    unit.zero_speed()
    unit.wait(60)
    assert unit.position() > 200
    unit.go(1, until_low=1)
    unit.kill()
    unit.initialize(position=False)
    assert unit.pins().outputs == (False, False, False)
    unit.initialize()
    assert unit.position() == 0
    unit.enter_programming()
    unit.set_start_stop(300)
    unit.mark()
    unit.activate(2)
    unit.move(5)
    unit.loop(3)
    assert not unit.moving()
    if signed:
        unit.jump(16)
        unit.jump_if(0, 0)
        unit.force(-4)
        unit.leave_programming()
    listed = ["S30", "L0", "A2", "+5", "L3"] + (["j16", "jc0,0", "f-4"] if signed else [])
    assert unit.read_program() == listed
    unit.save()
    unit.execute()
    unit.wait(60)
    assert unit.position() == (-4 if signed else 15)
    unit.recall()
    assert unit.read_program() == listed
    if signed:
        unit.force(-7)
        assert unit.position() == -7
    status = made.controller("module").status(made.now)
    assert status.state == "ready"


@pytest.mark.parametrize("model", MODELS)
def test_a_long_homing_is_waited_for_however_long_it_takes(model: str) -> None:
    made, unit = module(model, SWITCHES)
    unit.set_speeds(Speeds(50, 50, 0))
    unit.home()
    assert unit.moving()
    with pytest.raises(MotionFailed, match="still moves after 10 s"):
        unit.wait(10)
    unit.wait(600)
    assert made.now > 50 * 10**9  # 2000 steps there, 500 back, at 50 steps/s
    assert unit.position() == 0
    assert unit.read_program() == []


def test_while_it_moves_only_f_z_and_k_are_answered() -> None:
    _, unit = module("gs-c200")
    unit.move_by(1000)
    for action in (unit.position, unit.pins, unit.saved, lambda: unit.move_by(5), lambda: unit.activate(1)):
        with pytest.raises(Busy, match="wait"):
            action()
    unit.halt()
    assert 0 < unit.position() < 1000


def test_an_overflow_in_a_program_is_kept_for_whoever_waits() -> None:
    """Entry F: E5 "indicates that during the program execution the position counter has reached the overflow"."""
    _, unit = module("gs-c200")
    with pytest.raises(Refused, match="overflow of the position counter"):
        unit.move_by(-1)
    unit.write_program(["-1"])
    unit.execute()
    with pytest.raises(MotionFailed, match="overflow of the position counter"):
        unit.wait(60)
    unit.wait(60)


def test_the_ramp_takes_the_seconds_that_were_asked_for() -> None:
    made, unit = module("gs-c200")
    told = unit.set_speeds(Speeds(100, 1000, 0.5))
    assert told == Speeds(100, 1000, 550 / 1100)
    unit.run_at(1000)
    unit.stop()
    unit.wait(60)
    unit.move_by(2000)
    unit.wait(60)
    assert made.recording is not None
    span = made.recording.motion("module", made.now)[-1]
    assert span.train.time_of(275) - span.begins == pytest.approx(0.5e9, abs=2)


@pytest.mark.parametrize("place", range(1, 60))
@pytest.mark.parametrize("direction", ["sent", "received"])
@pytest.mark.parametrize("model", MODELS)
def test_a_program_arrives_right_whichever_character_is_damaged(model: str, direction: str, place: int) -> None:
    made = cell(f'[units.module]\nmodel = "{model}"')
    port = FaultyPort(made, **{direction: place})
    unit = BlockingGsC200(GsC200(model), port)
    program = ["A1", "A1", "+1234", "L2", "C1"]
    unit.write_program(program)
    while not port.spent:
        assert unit.read_program() == program
    assert unit.read_program() == program


def test_three_modules_share_a_line_and_a_port() -> None:
    text = [
        f'[units.m{number}]\nmodel = "gs-c200s"\nstraps = {{ SEL2 = {sel2}, SEL1 = {sel1}, SEL0 = {sel0} }}'
        for number, (sel2, sel1, sel0) in enumerate([(0, 1, 1), (1, 0, 1), (0, 0, 1)], 1)
    ]
    made = cell("\n".join(text) + '\n[lines.all]\nunits = ["m1", "m2", "m3"]')
    port = HostPort(made)
    units = [BlockingGsC200(GsC200("gs-c200s", address=number), port) for number in (1, 2, 3)]
    for number, unit in enumerate(units, 1):
        unit.set_speeds(Speeds(100, 1000 * number, 0.1))
        unit.move_to(-1000 * number)
    assert all(unit.moving() for unit in units)
    units[2].halt()
    for unit in units[:2]:
        unit.wait(60)
    assert [unit.position() for unit in units[:2]] == [-1000, -2000]
    assert -3000 < units[2].position() < 0
    with pytest.raises(NoAnswer, match="at address 7: does not answer to F"):
        BlockingGsC200(GsC200("gs-c200s", address=7), port).moving()
    assert not units[0].moving()


@pytest.mark.parametrize("rates", [("low", "low", "low"), ("open", "open", "open")], ids=["9600 baud", "110 baud"])
def test_answers_are_waited_for_as_long_as_their_characters_take(rates: tuple[str, str, str]) -> None:
    straps = ", ".join(f'BR{number} = "{level}"' for number, level in enumerate(rates))
    made = cell(f'[units.module]\nmodel = "gs-c200s"\nstraps = {{ {straps} }}')
    unit = BlockingGsC200(GsC200("gs-c200s", baud=9600 if "low" in rates else 110), HostPort(made))
    program = ["jc7,118"] * 59
    unit.write_program(program)
    assert unit.read_program() == program


def test_a_backup_comes_back_whatever_was_in_ram_and_eeprom() -> None:
    _, unit = module("gs-c200s")
    unit.write_program(["A1", "+5"])
    unit.save()
    unit.write_program(["C1"])
    saved = unit.saved()
    assert saved == {"model": "gs-c200s", "memory": "EEPROM", "program": ["A1", "+5"], "ram": ["C1"]}
    assert unit.read_program() == ["C1"]
    _, other = module("gs-c200s")
    assert other.restore(saved)[-1] == "The RAM holds the other program of 1 instruction, read back and right."
    assert other.saved() == saved
    assert other.restore(saved) == ["The EEPROM holds this program already: nothing was written to it."]


def test_a_gs_c200_keeps_what_was_restored_over_power_off() -> None:
    made, unit = module("gs-c200")
    told = unit.restore({"model": "gs-c200", "program": ["A1", "+5"]})
    assert "is in programming mode" in told[-1]
    made.power("module", False)
    made.power("module", True)
    unit.forget()
    assert unit.saved() == {"model": "gs-c200", "memory": "EEPROM", "program": ["A1", "+5"]}
    assert unit.read_program() == []
    assert made.controller("module").status(made.now).state == "ready"


def test_a_module_that_is_switched_off_does_not_answer() -> None:
    made, unit = module("gs-c200")
    made.power("module", False)
    with pytest.raises(NoAnswer, match="GS-C200: does not answer to F within"):
        unit.moving()
    with pytest.raises(DriverError, match="received nothing"):
        unit.move_by(5)


def test_an_error_of_an_old_program_is_told_of_no_move_that_this_driver_makes_or_asks_about() -> None:
    """Entry F: E5 is "during the program execution"; a program that somebody else has started is none of ours."""
    made, unit = module("gs-c200")
    made.type("module", "-100")  # E5 at once
    for line in ("P", "-100", "E"):
        made.type("module", line)
        made.run_to(made.now + 100_000_000)
    assert not BlockingGsC200(GsC200("gs-c200"), HostPort(made)).moving()
    for line in ("P", "-100", "E"):
        made.type("module", line)
        made.run_to(made.now + 100_000_000)
    unit.move_by(50)
    unit.wait(10)
    assert unit.position() == 50
    unit.write_program(["-100"])
    unit.execute()
    with pytest.raises(MotionFailed, match="E5"):
        unit.wait(10)


@pytest.mark.parametrize("stop", ["halt", "stop"])
def test_homing_that_is_stopped_below_0_sets_no_move_of_ten_million_steps_off(stop: str) -> None:
    """Entry K: "it is therefore advisable to always send a Home instruction after a Kill instruction"."""
    made, unit = module("gs-c200")
    unit.home(-1)
    made.run_to(made.now + 300_000_000)
    getattr(unit, stop)()
    place = unit.position()
    assert place > 9_999_000
    with pytest.raises(Refused, match=rf"counter reads {place}: a move to 0 would make {place} steps away from it"):
        unit.move_to(0)
    assert unit.position() == place
    unit.set_position(0)
    unit.move_to(30)
    unit.wait(10)
    assert unit.position() == 30
