"""What was said on a line is shown frame by frame, and what every byte of it was."""

from tests.workbench.told import Told, alone, example

from detent.cell.actions import Power, Send, SetPin, Type
from detent.lines.microbus import LET_GO
from detent.ticks import MS, SECOND
from detent.uart import characters
from detent.workbench.talk import Row, Talk, shown


def said(told: Told, line: str | None = None, since: int = 0) -> Talk:
    return told.talks.of(line or next(iter(told.picture.lines)), since)


def parts(row: Row) -> list[tuple[str, str]]:
    return [(part.kind, part.text) for part in row.parts]


def exchange(told: Told, *texts: str) -> tuple[Row, ...]:
    unit = next(iter(told.picture.units))
    for text in texts:
        told.history.do(Type(unit, text))
        told.run(told.history.now + SECOND)
    return said(told).rows


def test_a_frame_of_the_gs_c200_with_its_checksum_and_its_answer() -> None:
    """Datasheet, "Data exchange protocol": command, argument, checksum, CR."""
    host, answer = exchange(alone("gs-c200"), "S10")
    assert parts(host) == [("command", "S"), ("argument", "10"), ("checksum", "4"), ("end", "CR")]
    assert host.sender == ""
    assert (host.note, host.wrong, host.whole) == ("Set the start-stop speed.", False, True)
    assert parts(answer) == [("answer", "Y"), ("checksum", "Y"), ("end", "CR")]
    assert (answer.sender, answer.note) == ("gs-c200", "done, or begun")
    assert host.begin < host.end <= answer.begin < answer.end


def test_errors_are_explained_by_the_error_table() -> None:
    """Datasheet, error table: 2 is an argument missing, not wanted, or out of limits."""
    told = alone("gs-c200", CHS=0)
    rows = exchange(told, "A9", "Y7")
    assert rows[0].note.startswith("E2: A takes an output, 1 to 3")
    assert rows[1].note == "E2: argument missing, not wanted, not a number, or out of range"
    assert [row.wrong for row in rows] == [True] * 4
    assert parts(rows[0]) == [("error", "A9"), ("end", "CR")]


def test_a_wrong_checksum_is_seen() -> None:
    told = alone("gs-c200")
    told.history.do(Send(0, b"F!\r"))
    told.run(SECOND)
    host, answer = said(told).rows
    assert host.note == "wrong checksum, 21h instead of 56h: E1"
    assert parts(host) == [("command", "F"), ("error", "!"), ("end", "CR")]
    assert answer.note.startswith("E1: parity error, wrong checksum")


def test_a_damaged_character_is_told() -> None:
    told = alone("gs-c200", CHS=0)
    told.history.do(Send(0, b"F\x80\r"))  # too wide for seven bits
    told.run(SECOND)
    assert said(told).rows[0].note.startswith("damaged on the line")
    assert said(told).rows[0].wrong


def test_straps_that_are_moved_count_for_what_is_said_later() -> None:
    told = alone("gs-c200")
    exchange(told, "F")
    told.history.do(SetPin("gs-c200", "CHS", 0))
    told.history.do(Power("gs-c200", False))
    told.history.do(Power("gs-c200", True))
    rows = exchange(told, "F")
    assert parts(rows[0]) == [("command", "F"), ("checksum", "V"), ("end", "CR")]
    assert parts(rows[2]) == [("command", "F"), ("end", "CR")]


def test_lines_with_several_modules_show_addresses_and_who_answers() -> None:
    told = example("multipoint")
    told.run(SECOND)
    told.history.do(Type(list(told.picture.units)[1], "F"))
    told.run(2 * SECOND)
    host, answer = said(told).rows[-2:]
    assert host.parts[0].kind == "address"
    assert answer.sender == list(told.picture.units)[1]


def test_the_dcb_274_signs_on_echoes_and_refuses_with_a_hash() -> None:
    """Manual of the DCB-274, pages 21 and 22."""
    rows = exchange(alone("dcb-274"), "X", "%1")
    host = [row for row in rows if not row.sender]
    units = [row for row in rows if row.sender]
    assert host[0].note == "sign on"
    assert host[1].note.startswith("Print the settings")
    assert "SMC-27X2" in units[0].note
    assert host[2].note == "#: '%' is no command"
    assert host[2].wrong
    assert units[-1].parts[-2].text == "#"
    assert units[-1].wrong


def notes(model: str, *lines: str) -> list[str]:
    """What the unit's rows say in words."""
    told = alone(model)
    told.run(500 * MS)
    return [row.note for row in exchange(told, *lines) if row.sender]


def test_answers_are_explained_by_what_they_answer() -> None:
    """Datasheet of the GS-C200, V: inputs, then outputs, UI1 and UO1 the least significant."""
    assert notes("gs-c200", "A2", "V2", "V1") == [
        "done, or begun", "UI1=1, UI2=1, UI3=1, UO1=0, UO2=1, UO3=0", "position 0",
    ]  # fmt: skip


def test_answers_of_the_dcb_274_are_explained_by_its_table() -> None:
    """Manual of the DCB-274, pages 35, 52 to 54 and 56."""
    told = alone("dcb-274")
    told.history.do(SetPin("dcb-274", "HOME", 0))
    told.history.do(SetPin("dcb-274", "P2", 0))
    lines = ["X", "Z", "^", "] 0", "A 129", "] 1", "[ 0 2"]
    found = [row.note for row in exchange(told, *lines) if row.sender and row.data[:1] != b" "]
    assert found[0].startswith("ramp slopes 5/5, initial velocity 802, slew velocity 10370, divide all speeds 1, ")
    assert found[1:] == [
        "position 0", "0: at rest", "active: HOME, P2", "active ports: P2", "active: none", "the bytes 235 233",
    ]  # fmt: skip


def test_reports_of_a_genstepper_are_explained_by_its_tables() -> None:
    """Manual of the BS0610, pages 39 to 43."""
    found = notes("bs0610", "0?", "-8?", "5?")[-3:]
    assert "X: current location 0, current speed 80," in found[0]
    assert "windings 0 (off)" in found[0]
    assert found[1] == "X: step action 0 (idle); Y: step action 0 (idle)"
    assert found[2].startswith("X: limits 15 (LY-, LY+, LX-, LX+)")


def test_a_blank_is_seen_as_a_key() -> None:
    assert shown(b" ") == "SPACE"
    assert shown(b"  \r") == "SPACE SPACE CR"
    assert shown(b"Z  0") == "Z  0"


def test_genstepper_commands_are_a_number_and_a_character_and_answers_end_with_the_prompt() -> None:
    """Manual of the BS0610, pages 22 and 39 to 43."""
    told = alone("bs0610")
    told.run(500 * MS)
    rows = exchange(told, "-1?", "q")
    report = next(row for row in rows if row.parts[-1:] and row.parts[-1].text == "?")
    assert parts(report) == [("argument", "-1"), ("command", "?")]
    answers = [row for row in rows if row.sender]
    assert answers[1].note == "X: current location 0; Y: current location 0"
    assert answers[1].parts[-1].text == "*"
    assert next(row for row in rows if row.data == b"q").wrong


def test_supersigma_messages_are_bytes_with_a_meaning_each() -> None:
    """The paper's table 1: number, op-code, steps with the more significant byte first."""
    rows = exchange(alone("supersigma"), "move -400", "status", "09")
    assert [part.meaning for part in rows[0].parts] == [
        "to the drive 1", "move, backward: Move, with the ramps that the length allows.", "400 steps",
    ]  # fmt: skip
    assert [part.text for part in rows[0].parts] == ["01", "81", "01 90"]
    answer = next(row for row in rows if row.sender)
    assert answer.note == "400 steps"
    assert rows[-1].note == "09h is no op-code"


def test_the_lines_of_an_adapter_are_a_row_each() -> None:
    """The SIN-10 answers each command with a line (manual of the DCB-274, page 19); ours end with CR LF."""
    told = example("xyz-party-line")
    told.run(500 * MS)
    rows = said(told, "computer").rows
    assert [row.data for row in rows[:4]] == [
        b"&\r", b"X+1000;Y+1000;Z+1000;9W*;XZ;YZ;ZZ\r", b"XYZ\r\n", b"X+1000\r\n",
    ]  # fmt: skip
    assert parts(rows[2]) == [("answer", "XYZ"), ("end", "CR LF")]
    assert not any(row.note or row.wrong for row in rows)


def test_a_frame_that_is_not_finished_is_shown_and_asked_for_again() -> None:
    told = alone("gs-c200")
    told.history.do(Send(0, b"+10"))
    told.run(50 * MS)
    talk = said(told)
    assert not talk.rows[0].whole
    assert talk.next == 0
    told.history.do(Send(0, b"0"))
    told.run(100 * MS)
    again = said(told, since=talk.next)
    assert (again.first, again.rows[0].data) == (0, b"+100")
    told.run(SECOND)  # nothing more came
    assert said(told).rows[0].whole
    assert said(told).next == 1


def test_what_was_said_in_a_dropped_past_was_not_said() -> None:
    told = alone("gs-c200")
    exchange(told, "F", "S10")
    assert len(said(told).rows) == 4
    before = said(told).cut
    told.history.rewind(900 * MS)
    told.history.go()
    told.run(SECOND)
    assert len(said(told).rows) == 2
    assert said(told).cut != before


def test_control_characters_have_names() -> None:
    assert shown(b"F\r") == "F CR"
    assert shown(b"\r\nOK\x1b\x80") == "CR LF OK ESC 80h"


def test_half_a_message_on_a_microbus_ends_where_the_drives_forget_it() -> None:
    """docs/controllers/supersigma.md, "Half a message": behind a silence, or when the CCU lets go."""
    told = alone("supersigma")
    for half in (b"\x01\x01\x13", (*characters(b"\x01\x03"), LET_GO)):
        told.history.do(Send(0, half))
        told.run(told.history.now + (150 * MS if half == b"\x01\x01\x13" else MS))
    told.history.do(Send(0, b"\x01\x05"))
    told.run(told.history.now + SECOND)
    hosts = [row for row in said(told).rows if not row.sender]
    assert [row.data.hex(" ") for row in hosts] == ["01 01 13", "01 03", "01 05"]
    assert hosts[-1].note == "status"
    assert said(told).rows[-1].data.hex(" ") == "00 00 00"
