"""Lines and adapters of several DCB-274s: bit times, collisions, daisy chain, SIN-8, SIN-10 (pages 16 to 26)."""

import copy

import pytest

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import Problem, parse
from detent.ticks import MS, SECOND


def cell(*text: str, names: str = "XYZ", timed: bool = True, straps: str = "{}") -> Cell:
    lines = list(text)
    for name in names:
        lines += [f"[units.{name}]", 'model = "dcb-274"', f'options = {{ name = "{name}" }}', f"straps = {straps}"]
    return build(parse("\n".join(lines), "test"), lambda file: "", line_timing=timed)


def talk(cell: Cell, data: bytes, seconds: float = 1.0, line: int = 0) -> bytes:
    cell.send(line, data)
    cell.run_to(cell.now + int(seconds * SECOND))
    return bytes(heard.char.value for heard in cell.lines[line].take())


BUS = ("[lines.bus]", 'units = ["X", "Y", "Z"]')


def sin10(options: str = "", **choices: bool) -> Cell:
    straps = '{ B1 = "high" }' if "460800" in options else "{}"
    return cell(
        "[lines.pc]", 'units = ["sin"]', *BUS, 'host = "sin"', "[units.sin]", 'model = "sin-10"',
        f"options = {{ {options} }}", straps=straps, **choices,
    )  # fmt: skip


@pytest.mark.parametrize("timed", [True, False])
@pytest.mark.parametrize("options", ["", "baud = 115200, line_baud = 460800", "baud = 1200"])
def test_the_line_of_page_19_moves_three_axes_waits_and_reads_them(options: str, timed: bool) -> None:
    adapted = sin10(options, timed=timed)
    assert talk(adapted, b"&\r", 10) == b"XYZ\r\n"
    answer = talk(adapted, b"X+1000;Y+1000;Z+1000;9W*;XZ;YZ;ZZ\r", 10)
    assert answer == b"X+1000\r\nY+1000\r\nZ+1000\r\n9W*\r\nXZ     1000\r\nYZ     1000\r\nZZ     1000\r\n"


def test_the_scan_is_required_first_and_strangers_are_refused() -> None:
    adapted = sin10()
    assert talk(adapted, b"XZ\n") == b"#\r\n"
    talk(adapted, b"&\r", 3)
    assert talk(adapted, b"QZ;9WQ;9W;*Z;X;Xu;\r") == b"#\r\n#\r\n#\r\n#\r\nX\r\nXu#\r\n"


def test_an_axis_that_has_lost_its_supply_does_not_hold_the_adapter() -> None:
    adapted = sin10()
    talk(adapted, b"&\r", 3)
    adapted.power("Y", False)
    assert talk(adapted, b"YZ;XZ\r") == b"?\r\nXZ        0\r\n"


def test_esc_ends_a_wait_and_all_axes_answer_in_the_same_bit_times() -> None:
    adapted = sin10()
    talk(adapted, b"&\r", 3)
    talk(adapted, b"XM 500;9WX\r")
    assert adapted.controller("X").status(adapted.now).state == "moving"
    adapted.lines[0].take()
    assert talk(adapted, b"\x1b") == b"#\r\n"
    assert adapted.controller("X").status(adapted.now).state == "ready"


def test_the_buffer_holds_256_characters() -> None:
    adapted = sin10()
    talk(adapted, b"&\r", 3)
    long = b"XZ;" * 85  # 255
    assert talk(adapted, long + b"YYYYZ\r", 10).count(b"\r\n") == 86


def test_party_select_comes_from_the_adapter_and_counts_at_reset() -> None:
    adapted = cell(
        "[lines.pc]", 'units = ["sin"]', "[lines.bus]", 'units = ["X"]', 'host = "sin"', "[units.sin]",
        'model = "sin-8"', "[switches.ps]", 'drives = "sin.SWITCH"', 'level = "low"', names="X",
    )  # fmt: skip
    assert talk(adapted, b" ").endswith(b"V1.10\r\n")
    adapted.set_switch("ps", 1)
    assert talk(adapted, b"Z\r") == b"Z        0\r\n"
    assert talk(adapted, b"\x03XZ\n") == b"XZ        0\n"


def test_a_sin_8_adds_no_time() -> None:
    alone = cell("[lines.bus]", 'units = ["X"]', names="X")
    behind = cell("[lines.pc]", 'units = ["s"]', "[lines.bus]", 'units = ["X"]', 'host = "s"', "[units.s]",
                  'model = "sin-8"', 'options = { switch = "single" }', names="X")  # fmt: skip
    times = []
    for each in (alone, behind):
        each.send(0, b" X\r")
        each.run_to(SECOND)
        times.append(each.lines[0].take())
    assert times[0] == times[1]


def test_a_converter_cannot_wait_for_echoes_so_two_answers_collide() -> None:
    shared = cell(*BUS)
    heard = talk(shared, b"XZ\nYZ\n")
    assert heard != b"XZ        0\nYZ        0\n"
    polite = [talk(shared, bytes([value]), 0.02) for value in b"XZ\nYZ\n"]
    assert b"".join(polite) == b"XZ        0\nYZ        0\n"


def test_two_axes_of_one_name_answer_with_the_and_of_their_bits() -> None:
    shared = cell(*BUS, "[units.A]", 'model = "dcb-274"', 'options = { name = "X" }',
                  "[lines.other]", 'units = ["A", "B"]', "[units.B]",
                  'model = "dcb-274"', 'options = { name = "X" }')  # fmt: skip
    assert talk(shared, b"XO 1\n", line=1) == b"XO 1\n"
    assert talk(shared, b"XZ\n", line=1) == b"XZ        1\n"


def test_a_daisy_chain_names_its_axes_and_takes_a_character_time_from_each_to_the_next() -> None:
    ring = cell("[lines.ring]", 'units = ["X", "Y", "Z"]', 'kind = "daisy-chain"')
    assert talk(ring, b"\nA") == b"\nD"
    ring.send(0, b"Q")
    sent = ring.lines[0].host_busy_until
    ring.run_to(ring.now + SECOND)
    (heard,) = ring.lines[0].take()
    character = ring.lines[0].format.duration()
    assert abs(heard.at - sent - 3 * character) <= 3
    assert talk(ring, b"\nB+10\n") == b"\nB+10\n"
    assert talk(ring, b"BZ\nCX\n") == b"BZ       10\nCX  26\n"
    assert talk(ring, b"\x1b") == b"\x1b#\n#\n#\n"


def test_a_copy_of_a_cell_with_an_adapter_goes_on_alike() -> None:
    adapted = sin10()
    talk(adapted, b"&\r", 3)
    adapted.send(0, b"X+100;9W*;XZ\r")
    adapted.run_to(adapted.now + 20 * MS)
    twin = adapted.copy()
    for each in (adapted, twin):
        each.run_to(10 * SECOND)
    assert adapted.lines[0].take() == twin.lines[0].take()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ((*BUS, 'host = "X"'), "no adapter"),
        ((*BUS, 'host = "sin"', "[units.sin]", 'model = "sin-8"'), "no line to its own host"),
        ((*BUS, 'kind = "ring"'), "daisy-chain"),
        ((*BUS, 'host = "sin"', 'kind = "daisy-chain"', "[units.sin]", 'model = "sin-8"'), "either host or kind"),
        ((*BUS, 'host = "sin"', "[units.sin]", 'model = "sin-10"', "options = { line_baud = 38400 }",
          "[lines.pc]", 'units = ["sin"]'), "set the same"),
        (("[lines.bus]", 'units = ["X", "sin"]', "[units.sin]", 'model = "sin-8"'), "for itself"),
        (("[lines.pc]", 'units = ["sin"]', *BUS, 'host = "sin"', "[units.sin]", 'model = "sin-8"',
          "[[script]]", "at = 1", 'send = "Z"', 'to = "X"'), "send to sin"),
    ],
)  # fmt: skip
def test_what_cannot_be_wired_is_a_problem_with_its_key(text: tuple[str, ...], words: str) -> None:
    with pytest.raises(Problem, match=words):
        cell(*text)


def test_a_second_controller_follows_the_step_outputs_of_the_first() -> None:
    pair = cell("[[wires]]", 'from = "X.P4"', 'to = "Y.STEP"', "[[wires]]", 'from = "X.P5"', 'to = "Y.DIR"',
                names="XY", timed=False)  # fmt: skip
    talk(pair, b" l 2\rV 3000\rM 2000\r")
    talk(pair, b"M -3000\r", 2)
    talk(pair, b"@\r", 1)
    master, slave = (pair.controller(name).status(pair.now) for name in "XY")
    assert slave.position == master.position != 0
    assert slave.pulses == master.pulses > 5000


def test_a_sin_10_that_is_off_signs_on_at_space_and_looks_for_axes_at_an_ampersand() -> None:
    """Pages 4 and 21: "all (8) switches in off position", SPACE signs on; page 20: "selectable via host commands"."""
    adapted = cell("[lines.pc]", 'units = ["sin"]', "[lines.bus]", 'units = ["X"]', 'host = "sin"', "[units.sin]",
                   'model = "sin-10"', names="X")  # fmt: skip
    assert talk(adapted, b" ") == b"     110 AMS SMC-27X2 V1.10\r\n"
    assert talk(adapted, b"+30\r") == b"+30\r\n"
    assert talk(adapted, b"Z\r") == b"Z       30\r\n"
    assert talk(adapted, b"\x1b") == b"#\r\n"
    assert talk(adapted, b"&\r", 3) == b"X\r\n"
    assert talk(adapted, b"XZ;QZ\r") == b"XZ        0\r\n#\r\n"
    talk(adapted, b"\x03")
    assert talk(adapted, b"Q ") == b"Q     110 AMS SMC-27X2 V1.10\r\n"
    assert talk(adapted, b"X\r").endswith(b"n=Q\r\n")


def test_a_line_that_is_too_long_for_the_buffer_runs_no_half_of_a_command() -> None:
    """Page 19: 256 characters."""
    adapted = sin10()
    talk(adapted, b"&\r", 3)
    long = b"XZ;" * 83 + b"X+1000"  # 255
    assert talk(adapted, long + b"00\r", 10).endswith(b"\r\n#\r\n")
    assert adapted.controller("X").status(adapted.now).pulses == 0
    assert talk(adapted, b"X+1" + b"0" * 300 + b"\rX+5\r\rXZ\r", 10) == b"#\r\nX+5\r\nXZ        5\r\n"


def test_a_stop_for_one_axis_goes_through_while_the_adapter_waits() -> None:
    """Pages 19, 28, 33, 57: a program, a 9W, a command in its pending period; the other axis goes on."""
    adapted = sin10()
    talk(adapted, b"&\r", 3)
    talk(adapted, b"XP 0;XM 1000;XL 2048 0;XP;XG;YM 900\r", 2)
    assert adapted.controller("X").status(adapted.now).state == "running"
    assert talk(adapted, b"X|\r") == b"X|\r\n"
    assert [adapted.controller(name).status(adapted.now).state for name in "XY"] == ["ready", "moving"]
    assert talk(adapted, b"XG\r") == b"XG\r\n"
    assert talk(adapted, b"9WX;XZ\r", 2) == b""
    answer = talk(adapted, b"X@\r", 2)
    assert answer.startswith(b"X@\r\n9WX\r\nXZ")
    assert talk(adapted, b"X+90000;XR 0;XZ\r", 2) == b"X+90000\r\n"
    answer = talk(adapted, b"X|\r", 2)
    assert answer.startswith(b"XR 0#\r\nX|\r\nXZ")
    assert [adapted.controller(name).status(adapted.now).state for name in "XY"] == ["ready", "moving"]
    assert talk(adapted, b"XW 65535\r", 2) == b""
    assert talk(adapted, b"X@\r", 2) == b"XW 65535#\r\nX@\r\n"


BEFORE_A_STOP = (
    "X+5000", "XM 900", "XZ", "XS", "XC 0", "XC 1", "XW 500", "X[0 64;X[0 64", "XH 2", "9W*", "9WX", "YZ;YZ;YZ;YZ",
    "YR 9000;9WY;XZ", "X^;X^", "X@@", "QZ", "YS", "YC 1", "Y[0 64;YZ", "YR 9000;YR 0",
)  # fmt: skip


@pytest.mark.parametrize("moves", ["X+60000", "XM 2000", "XG 300"])
@pytest.mark.parametrize("before", BEFORE_A_STOP)
def test_a_stop_is_heeded_whenever_it_comes_behind_whatever_command(moves: str, before: str) -> None:
    """Page 57: | "may be used to individually ABORT a single axis". Page 29: S takes 60 ms, C 1 1500 ms."""
    adapted = sin10()
    talk(adapted, b"&\r", 3)
    talk(adapted, f"XP 300;XM 2000;XL 2048 0;XP;{moves}\r".encode(), 0.5)
    for stop in ("X@", "X|"):
        for gap in (0, 5, 12, 19, 26, 40, 80):
            at_it = copy.deepcopy(adapted)
            talk(at_it, f"{before}\r".encode(), gap / 1000)
            answer = talk(at_it, f"{stop}\r".encode(), 2.0 if before == "XC 1" else 0.6)
            assert f"{stop}\r\n".encode() in answer, (stop, gap)
            assert at_it.controller("X").status(at_it.now).state == "ready", (stop, gap)
