import json
from typing import Any

import pytest
from tests.realtime.served import address, served

from detent.cli import main
from detent.cli.send import escaped, unescaped

pytestmark = pytest.mark.waits


def told(capsys: pytest.CaptureFixture[str], *words: str, status: int = 0) -> tuple[str, str]:
    with pytest.raises(SystemExit) as ended:
        main(["send", *words])
    out, err = capsys.readouterr()
    assert ended.value.code == status, err
    return out, err


def test_lines_go_out_framed_and_answers_are_explained(capsys: pytest.CaptureFixture[str]) -> None:
    with served("gs-c200s") as service:
        out, _ = told(capsys, "gs-c200s", address(service), "F", "V1", "V2")
    assert out.splitlines() == [
        "> F",
        "< R  (ready)",
        "> V1",
        "< V+0  (position 0)",
        "> V2",
        "< V70  (UI1=1, UI2=1, UI3=1, UO1=0, UO2=0, UO3=0)",
    ]


def test_a_line_with_a_hyphen_stands_behind_two(capsys: pytest.CaptureFixture[str]) -> None:
    with served("gs-c200s") as service:
        out, _ = told(capsys, "gs-c200s", address(service), "--", "-100")
        assert out == "> -100\n< Y  (done, stored or begun)\n"


def test_a_mistyped_option_is_not_sent_to_the_unit(capsys: pytest.CaptureFixture[str]) -> None:
    out, err = told(capsys, "gs-c200s", "/dev/no-such-device", "F", "--adress", "3", status=2)
    assert out == ""
    assert "Did you mean --address?" in err


def test_a_refused_line_ends_it_with_1_and_the_datasheets_words(capsys: pytest.CaptureFixture[str]) -> None:
    # "E2: command argument out of limit or not requested"
    with served("gs-c200") as service:
        out, _ = told(capsys, "gs-c200", address(service), "A9", "F", status=1)
    assert out == "> A9\n< E2  (command argument out of limit or not requested)\n> F\n< R  (ready)\n"


def test_a_program_is_listed_to_its_end(capsys: pytest.CaptureFixture[str]) -> None:
    with served("gs-c200s") as service:
        out, _ = told(capsys, "gs-c200s", address(service), "Po", "A1", "+50", "Px", "Q")
    assert out.endswith("> Q\n< A1\n< +50\n< END\n")


def test_json_has_what_was_said(capsys: pytest.CaptureFixture[str]) -> None:
    with served("gs-c200") as service:
        out, _ = told(capsys, "gs-c200", address(service), "F", "--json")
    found: dict[str, Any] = json.loads(out)
    assert found["exchanges"] == [{"sent": "F", "answers": ["R"], "meaning": "ready", "refused": False}]


def test_json_has_what_was_said_before_something_failed(capsys: pytest.CaptureFixture[str]) -> None:
    with served("supersigma") as service:
        out, err = told(capsys, "supersigma", address(service), "move 100", "jump", "--json", status=2)
    assert [exchange["sent"] for exchange in json.loads(out)["exchanges"]] == ["move 100"]
    assert "type move STEPS" in err


def test_bytes_go_out_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    with served("gs-c200") as service:
        out, _ = told(capsys, "gs-c200", address(service), "--raw", r"F\x56\r", "--wait", "0.2")
    assert out == "> FV\\r\n< RR\\r\n"
    assert unescaped(r"\x1b\n\\x") == b"\x1b\n\\x"
    assert escaped(b"\x1b\n\\x\xff") == r"\x1b\n\\x\xff"
    out, err = told(capsys, "gs-c200", "/dev/no-such-device", "--raw", "\\x1", status=2)
    assert "escapes like" in err


def test_every_model_is_spoken_to_in_its_own_way(capsys: pytest.CaptureFixture[str]) -> None:
    with served("dcb-274") as service:
        out, _ = told(
            capsys, "dcb-274", address(service), "--patience", "1", "+100", "W 0", "Z", "Q 0", "foo", status=1
        )
    shown = out.splitlines()
    assert shown[:6] == ["> +100", "<  (done)", "> W 0", "<  (done)", "> Z", "<       100  (position 100)"]
    assert "< 0 + 1001" in shown
    assert shown[-1].startswith("< #  (refuses 'foo'")
    with served("dcb-274", straps={"PARTY": "high"}) as service:
        out, _ = told(capsys, "dcb-274", address(service), "--patience", "1", "--name", "A", "X")
    assert out == "> X\n<   26\n"  # "the model, in party line" (page 52)
    with served("bs0610") as service:
        out, _ = told(capsys, "bs0610", address(service), "--patience", "10", "X100GI", "--", "-1?", "500")
    assert out.splitlines() == [
        "> X100GI",
        "< *  (done)",
        "> -1?",
        "< X,-1,100  (X: position 100)",
        "< *",
        "> 500",
        "< *  (done)",
    ]
    with served("supersigma") as service:
        out, _ = told(capsys, "supersigma", address(service), "--patience", "10", "status", "move +100")
    assert out == "> status\n< 0 steps  (at rest)\n> move +100\n<  (sent; status tells what comes of it)\n"


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("Q", "Q is no command"),
        ("1000Q", "Q is no command"),
        ("X7M", "M takes 0 to 1, not 7"),
        ("X9W", "W takes 0 to 2, not 9"),
        ("X5O", "O takes 0 to 3, not 5"),
        ("5HX1W", "H takes 0 to 1, not 5"),
    ],
)
def test_what_a_board_ignores_is_not_done(line: str, why: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Page 24: a board answers every character, whether it means anything or not."""
    with served("bs0610") as service:
        out, _ = told(capsys, "bs0610", address(service), "--patience", "10", line, status=1)
    assert out == f"> {line}\n< *  (ignored: {why})\n"


def test_reports_of_a_board_have_their_meaning(capsys: pytest.CaptureFixture[str]) -> None:
    with served("bs0610") as service:
        out, _ = told(capsys, "bs0610", address(service), "--patience", "10", "X800R", "--", "X-10?", "X-8?", "X0?")
    assert "< X,-10,800  (X: run rate 800)" in out
    assert "< X,-8,0  (X: action idle)" in out
    assert "run rate 800, stop rate 80)" in out


def test_a_wait_of_a_board_has_an_end(capsys: pytest.CaptureFixture[str]) -> None:
    with served("bs0610") as service:
        _, err = told(capsys, "bs0610", address(service), "--patience", "1", "--wait", "0.1", "X100000G", "I", status=1)
    assert "does not say within 0.1 s that it is idle" in err


def test_another_controller_behind_a_port_is_told_with_what_looks_for_it(capsys: pytest.CaptureFixture[str]) -> None:
    with served("bs0610") as service:
        port = address(service)
        out, err = told(capsys, "gs-c200", port, "--patience", "0.3", "+100", status=1)
        assert "(what came reads like a GenStepper board, bs0610)? See: detent find " + port in err
        assert "position()" not in out + err


@pytest.mark.parametrize(("begin", "end"), [("P 0", "P"), ("P", "P 0"), ("P0", "P 7"), ("P", "P")])
def test_a_program_of_a_dcb_274_is_traced_as_it_runs(begin: str, end: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Page 38: G with 1 prints each instruction. Page 47: any P ends program mode."""
    with served("dcb-274") as service:
        out, _ = told(capsys, "dcb-274", address(service), "--patience", "2", begin, "+ 10", "W 0", end, "G 0 1")
    assert "(the program has ended)" in out
    assert "+ 10" in next(line for line in out.splitlines() if line.startswith("|"))


def test_a_sequence_that_is_refused_leaves_no_program_mode_behind(capsys: pytest.CaptureFixture[str]) -> None:
    with served("dcb-274") as service:
        port = address(service)
        _, err = told(capsys, "dcb-274", port, "--patience", "2", "P 0", "A 8", "A 1000", status=1)
        assert "a line was refused: program mode was ended (P)" in err
        out, _ = told(capsys, "dcb-274", port, "--patience", "2", "X")
        assert "n=" in out
        told(capsys, "dcb-274", port, "--patience", "2", "P", "A 8")  # and leaves it so
        out, err = told(capsys, "dcb-274", port, "--patience", "2", "P 0", "Q 0")
        assert "A 8" in out
    with served("gs-c200s") as service:
        _, err = told(capsys, "gs-c200s", address(service), "Po", "A1", "A9", status=1)
        assert "programming mode was left (Px)" in err
        told(capsys, "gs-c200s", address(service), "V1")
    with served("gs-c200") as service:
        _, err = told(capsys, "gs-c200", address(service), "P", "A9", status=1)
        assert "E leaves it, and starts the program" in err


def test_single_characters_of_the_dcb_274_are_typed_as_words(capsys: pytest.CaptureFixture[str]) -> None:
    with served("dcb-274") as service:
        out, _ = told(capsys, "dcb-274", address(service), "--patience", "1", "M 1000", "@", "ESC", "^C", "^N B", "X")
    assert "> ESC\n<  (everything stopped at once)\n" in out
    assert "> @\n<  (slowing down)\n" in out
    assert "n=B" in out.splitlines()[-1]


def test_a_module_with_checksums_tells_who_sends_none(capsys: pytest.CaptureFixture[str]) -> None:
    with served("gs-c200") as service:
        out, _ = told(capsys, "gs-c200", address(service), "F", "--no-checksum", status=1)
    assert "it answers with a checksum, so it wants one" in out


@pytest.mark.parametrize(
    ("words", "status", "remedy"),
    [
        (("gs-c20", "PORT", "F"), 2, "did you mean gs-c200?"),
        (("gs-c200", "PORT"), 2, "say what to send: detent send MODEL PORT LINE"),
        (("gs-c200", "PORT", "F", "--raw", "--wait", "-1"), 2, "--wait -1: say 0 seconds or more"),
        (("gs-c200", "PORT", "F", "--name", "A"), 2, "--name is not for a gs-c200; it takes --address, --no-checksum"),
        (("gs-c200", "PORT", "F", "--address", "9"), 2, "an address is 1 to 7"),
        (("gs-c200", "/dev/no-such-device", "F"), 1, "there is no such device; detent find"),
        (("gs-c200", "rfc2217://PORT", "F"), 2, "no HOST:PORT"),
        (("gs-c200", "PORT", "\u00e9"), 2, "is no command line"),
        (("supersigma", "PORT", "jump"), 2, "type move STEPS"),
        (("bs0610", "PORT", " "), 2, "is no command line"),
        (("dcb-274", "PORT", "X"), 1, "does not answer SPACE"),
        (("dcb-274", "PORT", "+1234567890123456"), 2, "a line has 15"),
        (("gs-c200", "PORT", "F", "--address", "2", "--patience", "0.05"), 1, "at address 2: does not"),
    ],
)
def test_what_is_wrong_is_one_line_with_a_remedy(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...], status: int, remedy: str
) -> None:
    with served("gs-c200", straps={"SEL0": "low"}) as service:
        given = [address(service) if word == "PORT" else word for word in words]
        out, err = told(capsys, *given, status=status)
    assert out == ""
    assert remedy in err
    assert err.count("\n") == 1


LOOP = ("P 0", "+ 10", "W 0", "Z", "J 0 2", "P")  # prints three positions


def test_what_a_program_prints_is_heard_until_it_ends(capsys: pytest.CaptureFixture[str]) -> None:
    """Page 53: Z in a program prints the position; nothing is traced here."""
    with served("dcb-274") as service:
        port = address(service)
        out, _ = told(capsys, "dcb-274", port, "--patience", "2", *LOOP, "G 0", "Z")
        lines = out.splitlines()
        assert lines[lines.index("> G 0") + 1 :][:5] == [
            "<  (started)",
            "| 10",
            "| 20",
            "| 30",
            "< (the program has ended)",
        ]
        assert "30" in lines[-1]
        out, _ = told(capsys, "dcb-274", port, "--patience", "2", "G 0", "--json")
        (only,) = json.loads(out)["exchanges"]
        assert (only["printed"], only["program"]) == (["40", "50", "60"], "the program has ended")


def test_a_program_without_an_end_is_left_running_and_a_stop_behind_it_waits_for_nothing(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with served("dcb-274") as service:
        port = address(service)
        endless = ("P 0", "+ 10", "W 0", "Z", "G 0", "P")
        out, _ = told(capsys, "dcb-274", port, "--patience", "2", *endless, "G 0", "--wait", "0.5")
        assert "| 10\n" in out
        assert "(the program still runs; ESC ends it" in out
        out, _ = told(capsys, "dcb-274", port, "--patience", "2", "ESC", "G 0", "ESC", "Z")
        assert "the program" not in out
