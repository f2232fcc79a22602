"""The scheduler: the order within one instant, scripts, power, stored images, oscillation."""

import pytest
from tests.cell.cells import cell, edges, pulses

from detent.cell.build import build
from detent.cell.circuit import Oscillation
from detent.cell.description import single
from detent.cell.recording import InputSet, Received
from detent.controllers.device import Powered, StoreImage
from detent.ticks import MS, SECOND, US
from detent.uart import Char

ONE = '[units.unit]\nmodel = "gs-c200s"\nstraps = {CHS = 0}\n'
TWO = ONE.replace("unit]", "first]") + ONE.replace("unit]", "second]")


def say(made, unit: str, text: str) -> list[str]:
    """The answers of this instant."""
    line = made.lines[made.wiring.line_of[made.unit(unit)]]
    line.take()
    made.type(unit, text)
    return bytes(heard.char.value for heard in line.take()).decode().split()


# -- time ----------------------------------------------------------------------------------------------------


def test_a_cell_at_rest_has_nothing_left_to_do() -> None:
    made = cell(ONE)
    made.run_to(1 * MS)  # RESET goes up
    assert made.next_event() is None
    assert made.step() is None
    made.run_to(5 * SECOND)
    assert made.now == 5 * SECOND


def test_a_step_is_one_eventful_instant() -> None:
    made = cell(ONE)
    assert made.next_event() == 400 * US
    assert made.step() == 400 * US
    made.type("unit", "A1")
    assert made.step() == 1400 * US
    assert made.step() is None


def test_running_to_the_past_changes_nothing() -> None:
    made = cell(ONE)
    made.run_to(1 * SECOND)
    made.run_to(1 * MS)
    assert made.now == 1 * SECOND


# -- wires ---------------------------------------------------------------------------------------------------


def test_a_wire_carries_a_level_in_the_instant_it_changes() -> None:
    made = cell(TWO + '[[wires]]\nfrom = "first.UO1"\nto = ["second.UI1", "second.UI2"]\n')
    assert say(made, "second", "V2") == ["V40"]  # an output rests at 0
    made.type("first", "A1")
    assert say(made, "second", "V2") == ["V70"]
    made.power("first", False)  # lets go: the pull-up makes it 1
    assert say(made, "second", "V2") == ["V70"]
    made.power("first", True)
    assert say(made, "second", "V2") == ["V40"]


def test_an_output_wired_to_its_own_input_passes_a_wait() -> None:
    made = cell(ONE + '[[wires]]\nfrom = "unit.UO1"\nto = "unit.UI1"\n')
    for text in ["Po", "A1", "W1", "C1", "A2", "E"]:
        assert say(made, "unit", text) == ["Y"]
    made.run_to(1 * SECOND)
    assert edges(made, "unit", "UO2")[-1] == (3 * MS, 1)


def test_ready_outputs_share_a_wire() -> None:
    """GS-C200 datasheet, pin 14: RDY is an open collector."""
    text = TWO + ONE.replace("unit]", "third]")
    for unit in ("first", "second"):
        text += f'[[wires]]\nfrom = "{unit}.RDY"\nto = "third.UI1"\n'
    made = cell(text)
    levels = []
    made.type("first", "D1")
    made.type("second", "D2")
    for until in (50, 150, 250):
        made.run_to(until * MS)
        levels.append(say(made, "third", "V2")[0])
    assert levels == ["V60", "V60", "V70"]


def test_shared_enable_lines_synchronise_modules() -> None:
    """GS-C200 datasheet, "Complex movements synchronization", figure 13A."""
    made = cell(TWO + '[switches.go]\ndrives = ["first.ENABLE", "second.ENABLE"]\nlevel = 0\n'
                '[[script]]\nat = 1.0\nset = {go = 1}\n')  # fmt: skip
    made.type("first", "+50")
    made.run_to(100 * MS)
    made.type("second", "-50")
    made.run_to(3 * SECOND)
    assert pulses(made, "first") == pulses(made, "second")
    assert pulses(made, "first")[0] == 1 * SECOND


def test_a_clock_wire_gives_the_pulses_of_the_recording() -> None:
    text = TWO + '[[wires]]\nfrom = "first.CLOCK"\nto = "second.UI1"\n'
    made = cell(text)
    made.type("first", "+50")
    made.run_to(1 * SECOND)
    falls = [at for at, level in edges(made, "first", "CLOCK") if level == 0]
    assert falls == pulses(made, "first")
    alone = cell(ONE)
    alone.type("unit", "+50")
    alone.run_to(1 * SECOND)
    assert pulses(alone, "unit") == falls
    assert edges(alone, "unit", "CLOCK") == [(0, 1)]  # nobody listens: not an event each


def test_oscillation_is_told_with_its_pins() -> None:
    """Parts that answer each change of a pin with a change, at once."""
    made = cell(
        ONE + '[units.watch]\nmodel = "step-detector"\n[[wires]]\nfrom = "unit.CLOCK"\nto = "watch.CLOCK"\n'
        '[[wires]]\nfrom = "watch.DONE"\nto = "unit.ENABLE"\n'
    )
    part = made.parts[made.unit("watch")]
    level = [1]

    def restless(pin: str, value: int, now: int) -> None:
        level[0] = 1 - level[0]
        part._driver.set("DONE", level[0], now)

    class Eager:
        def __init__(self) -> None:
            self.pins = part.pins

        def __getattr__(self, name: str):
            return getattr(part, name)

        set_pin = staticmethod(restless)

    made.parts[made.unit("watch")] = Eager()  # answers each change with a change
    enable = made.parts[made.unit("unit")]
    inputs = enable.set_pin

    class Echo:
        def __getattr__(self, name: str):
            return getattr(enable, name)

        def set_pin(self, pin: str, value: int, now: int) -> None:
            inputs(pin, value, now)
            enable._driver.set("CLOCK", 1 - enable._driver.levels["CLOCK"], now)

    made.parts[made.unit("unit")] = Echo()
    with pytest.raises(Oscillation) as caught:
        made.set_pin("unit", "ENABLE", 0)
    assert "unit.ENABLE" in str(caught.value)
    assert "watch.CLOCK" in str(caught.value)
    assert "break the loop" in str(caught.value)


def test_many_changes_in_one_instant_are_no_oscillation() -> None:
    made = cell(ONE)
    for _ in range(400):
        made.set_pin("unit", "UI1", 0)
        made.set_pin("unit", "UI1", 1)
    made.run_to(1)
    for _ in range(400):
        made.set_pin("unit", "UI1", 0)
        made.set_pin("unit", "UI1", 1)
    assert made.recording is not None
    assert len([entry for entry in made.recording.of("unit") if isinstance(entry, InputSet)]) == 1600


# -- scripts and power ---------------------------------------------------------------------------------------


def test_a_script_sets_sends_and_switches_in_order_of_time() -> None:
    made = cell(
        ONE + '[switches.start]\ndrives = "unit.UI1"\nlevel = 0\n'
        "[[script]]\nat = 0.5\nset = {start = 1}\n"
        '[[script]]\nat = 0.2\nsend = ["A1", "V2"]\nto = "unit"\n'
        '[[script]]\nat = 0.3\nset = {"unit.UI2" = 0}\nsend = "V2"\nto = "unit"\n'
        "[[script]]\nat = 0.7\npower = {unit = false}\n"
        "[[script]]\nat = 0.8\npower = {unit = true}\n"
    )
    made.run_to(1 * SECOND)
    said = bytes(heard.char.value for heard in made.lines[0].take()).decode().split()
    assert said == ["Y", "B", "V41"]
    entries = made.recording.of("unit")
    assert [entry for entry in entries if isinstance(entry, Powered)] == [
        Powered(0, True),
        Powered(700 * MS, False),
        Powered(800 * MS, True),
    ]
    assert [entry for entry in entries if isinstance(entry, InputSet)] == [
        InputSet(0, "UI1", 0),
        InputSet(300 * MS, "UI2", 0),
        InputSet(500 * MS, "UI1", 1),
    ]
    assert edges(made, "unit", "UO1") == [(0, 0), (200 * MS, 1), (800 * MS, 0)]


def test_what_is_sent_at_one_time_is_sent_in_file_order_with_line_timing() -> None:
    made = cell(ONE + '[[script]]\nat = 0\nsend = ["F", "V1"]\nto = "unit"\n', line_timing=True)
    made.run_to(1 * SECOND)
    heard = made.lines[0].take()
    assert bytes(item.char.value for item in heard) == b"R\rV+0\r"
    received = [entry for entry in made.recording.of("unit") if isinstance(entry, Received)]
    assert bytes(entry.char.value for entry in received) == b"F\rV1\r"
    assert [entry.at for entry in received] == [1_145_833, 2_291_667, 3_437_500, 4_583_333, 5_729_167]
    assert [entry.began for entry in received] == [0, 1_145_833, 2_291_667, 3_437_500, 4_583_333]


def test_a_unit_that_is_not_powered_waits_for_the_script() -> None:
    made = cell(ONE + "powered = false\n[[script]]\nat = 1\npower = {unit = true}\n")
    assert say(made, "unit", "F") == []
    made.run_to(2 * SECOND)
    assert say(made, "unit", "F") == ["R"]
    assert [e for e in made.recording.of("unit") if isinstance(e, Powered)] == [Powered(1 * SECOND, True)]


def test_power_twice_is_power_once() -> None:
    made = cell(ONE)
    made.power("unit", True)
    made.power("unit", False)
    made.power("unit", False)
    assert [e.on for e in made.recording.of("unit") if isinstance(e, Powered)] == [True, False]


def test_a_power_cycle_keeps_the_shaft_and_clears_the_position() -> None:
    made = cell(ONE + "shaft = 1000\n")
    made.type("unit", "+7")
    made.run_to(1 * SECOND)
    made.power("unit", False)
    made.power("unit", True)
    made.type("unit", "+5")
    made.run_to(2 * SECOND)
    assert made.controller("unit").status(made.now).position == 5
    assert made.controller("unit").status(made.now).pulses == 12
    spans = made.recording.motion("unit", made.now)
    assert [(span.shaft, span.last) for span in spans] == [(1000, 7), (1007, 5)]


def test_programs_are_loaded_and_started_at_time_0() -> None:
    made = cell(ONE + 'program = "go.gsc"\n', {"go.gsc": "A1\nD1\nC1\n"})
    assert edges(made, "unit", "UO1") == [(0, 0), (0, 1)]
    made.run_to(1 * SECOND)
    assert edges(made, "unit", "UO1")[-1] == (102 * MS, 0)
    assert say(made, "unit", "Q") == ["A1", "D1", "C1", "END"]


def test_eeprom_images_come_from_the_store_or_from_the_file() -> None:
    kept: dict[str, bytes] = {}

    def store(unit: str, image: bytes) -> bool:
        kept[unit] = image
        return True

    stand_alone = ONE.replace("CHS = 0", "CHS = 0, REC = 0") + 'eeprom = "p.gsc"\n'
    text = stand_alone + '[switches.home]\ndrives = ["unit.EOT", "unit.HOME"]\nlevel = 0\n'
    made = cell(text, {"p.gsc": "A1\n"}, store=store)
    made.run_to(10 * MS)
    assert edges(made, "unit", "UO1")[-1] == (0, 1)
    for command in ("Po", "A2", "M", "Px"):
        assert say(made, "unit", command) == ["Y"]
    assert kept == {"unit": b"A\x02"}
    assert any(isinstance(entry, StoreImage) for entry in made.recording.of("unit"))
    again = cell(text, {"p.gsc": "A1\n"}, images=kept)
    again.run_to(10 * MS)
    assert edges(again, "unit", "UO2")[-1] == (0, 1)
    assert edges(again, "unit", "UO1") == [(0, 0)]


def test_a_store_that_fails_is_answered_E6() -> None:
    made = cell(ONE, store=lambda unit, image: False)
    assert say(made, "unit", "M") == ["E6"]


def test_without_a_recording_the_same_happens() -> None:
    made = cell(ONE, record=False)
    assert made.recording is None
    assert say(made, "unit", "A1") == ["Y"]
    made.run_to(1 * SECOND)
    assert say(made, "unit", "V2") == ["V71"]


def test_multipoint_units_share_their_line() -> None:
    units = "".join(
        f'[units.u{n}]\nmodel = "gs-c200"\nstraps = {{CHS = 0, {straps}}}\n'
        for n, straps in ((4, "SEL0 = 0"), (5, "SEL0 = 0, SEL2 = 0"))
    )
    made = cell(units + '[lines.bus]\nunits = ["u4", "u5"]\n')
    assert say(made, "u5", "+5") == ["Y"]
    assert say(made, "u4", "V1") == ["V0"]
    made.run_to(1 * SECOND)
    assert say(made, "u5", "V1") == ["V5"]
    assert len(made.lines) == 1
    assert made.wiring.line_names == ("bus",)


def test_damaged_characters_of_a_host_reach_the_unit_so_and_are_replayed() -> None:
    damaged = [Char(ord("F"), parity_ok=False), Char(13)]
    made = build(single("gs-c200"), lambda file: "")
    made.send(0, damaged)
    made.run_to(100 * MS)
    assert made.recording is not None
    heard = [entry.char for entry in made.recording.of("gs-c200") if isinstance(entry, Received)]
    assert heard == damaged
    again = build(single("gs-c200"), lambda file: "", journal=made.journal)
    again.run_to(100 * MS)
    assert again.recording is not None
    assert list(again.recording) == list(made.recording)


def test_any_number_of_commands_in_one_instant_are_sent_and_replayed() -> None:
    """A script of 500 lines at one time, and 500 sent by a hand at one time: the journal makes the same recording."""
    lines = ", ".join(['"V1"'] * 500)
    text = f'{ONE.replace("unit]", "x]")}[[script]]\nat = "1 ms"\nsend = [{lines}]\nto = "x"\n'
    made = cell(text)
    made.run_to(1 * SECOND)
    for _ in range(500):
        made.type("x", "V1")
    made.run_to(2 * SECOND)
    again = cell(text, journal=list(made.journal))
    again.run_to(2 * SECOND)
    assert list(made.recording or ()) == list(again.recording or ())
    assert len(made.journal) == 500


def test_a_cell_is_not_run_to_a_time_that_it_cannot_reach() -> None:
    made = cell(ONE)
    made.run_to(1_000_000 * 31_557_600 * SECOND)
    with pytest.raises(ValueError, match="this cell runs to"):
        made.run_to(1 << 100)
    motor = '[motors.m]\nmotor = "as1010"\nunit = "unit"\nsupply = 24\n'
    with pytest.raises(ValueError, match="at most"):
        cell(ONE + motor).run_to(1 << 63)
