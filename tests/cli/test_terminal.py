import io
import json
import sys
import threading
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import pytest
from prompt_toolkit.application import create_app_session
from prompt_toolkit.completion import CompleteEvent
from prompt_toolkit.document import Document
from prompt_toolkit.input import create_pipe_input
from prompt_toolkit.input.base import PipeInput
from prompt_toolkit.output import DummyOutput
from tests.realtime.served import address, served

from detent.cli import main
from detent.cli.terminal import _typed, explained, fits, prompt
from detent.workbench.words import words


class Keyboard(io.StringIO):
    """A standard input that is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def keys(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[PipeInput]:
    """What a person types."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(sys, "stdin", Keyboard())
    with create_pipe_input() as pipe, create_app_session(input=pipe, output=DummyOutput()):
        yield pipe


def terminal(*choices: str, status: int = 0) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["terminal", *choices])
    assert ended.value.code == status


def test_what_is_typed_is_answered_and_explained_until_ctrl_d(
    keys: PipeInput, capsys: pytest.CaptureFixture[str]
) -> None:
    keys.send_text("F\rA9\r\r+1")
    keys.send_text("\x03")  # Ctrl-C empties the line
    keys.send_text("V1\r\x04")
    with served("gs-c200") as service:
        terminal("gs-c200", address(service))
    out = capsys.readouterr().out
    assert out.splitlines()[1:] == [
        "< R  (ready)",
        "< E2  (command argument out of limit or not requested)",
        "< V0  (position 0)",
    ]
    assert out.startswith("Talking to the SGS-THOMSON GS-C200 intelligent stepper motor controller at /dev/pts/")


def test_tab_completes_a_command_from_the_models_table(keys: PipeInput) -> None:
    completer = prompt("gs-c200s", words("gs-c200s")).completer
    assert completer is not None
    (only,) = completer.get_completions(Document("jc"), CompleteEvent())
    assert (only.text, only.start_position) == ("jc", -2)
    assert only.display_meta_text == "Jump to a memory location if the inputs have the given value."
    every = [one.display_text for one in completer.get_completions(Document(""), CompleteEvent())]
    assert sorted(set(every)) == sorted(every)  # each command once, however it may be spelled
    assert {"F", "Vx", "jcy,xxx", "Po"} <= set(every)
    words_of_drive = prompt("supersigma", words("supersigma")).completer
    assert words_of_drive is not None
    assert [one.text for one in words_of_drive.get_completions(Document("ori"), CompleteEvent())] == ["originate "]


def test_what_was_typed_is_there_the_next_time(
    keys: PipeInput, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    with served("gs-c200") as service:
        keys.send_text("V2\r\x04")
        terminal("gs-c200", address(service))
        assert "+V2" in (tmp_path / "detent" / "gs-c200.history").read_text()
        keys.send_text("\x1b[A\r\x04")  # arrow up
        terminal("gs-c200", address(service))
    assert capsys.readouterr().out.count("< V70") == 2


def test_a_history_that_cannot_be_kept_is_no_trouble(
    keys: PipeInput, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "detent").write_text("a file where a folder should be")
    keys.send_text("F\r\x04")
    with served("gs-c200") as service:
        terminal("gs-c200", address(service))
    out, err = capsys.readouterr()
    assert out.endswith("< R  (ready)\n")
    assert "what is typed is not kept" in err


@pytest.mark.parametrize(
    ("model", "lines", "answers"),
    [
        ("gs-c200s", "V1\n", "> V1\n< V+0  (position 0)\n"),
        ("bs0610", "-1?\n", "> -1?\n< X,-1,0  (X: position 0)\n< Y,-1,0  (Y: position 0)\n< *\n"),
        ("dcb-274", "Z\n", "> Z\n<         0  (position 0)\n"),
        ("supersigma", "status\n\n", "> status\n< 0 steps  (at rest)\n"),
    ],
)
def test_without_a_port_a_unit_is_emulated_to_talk_to(
    model: str, lines: str, answers: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(lines))
    terminal(model)
    assert capsys.readouterr().out == answers


def test_lines_of_a_pipe_that_are_refused_or_fail_end_it_with_1(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO("A9\nF\n\u00e9\n"))
    terminal("gs-c200", status=1)
    out = capsys.readouterr().out
    assert out.splitlines()[:4] == [
        "> A9",
        "< E2  (command argument out of limit or not requested)",
        "> F",
        "< R  (ready)",
    ]
    assert out.splitlines()[-1].startswith("! ")
    monkeypatch.setattr(sys, "stdin", io.StringIO("\u00e9\n"))
    terminal("gs-c200", "--json", status=1)
    assert "is no command line" in json.loads(capsys.readouterr().out)["error"]


def test_an_unknown_model_and_options_for_no_port_are_asked_wrongly(capsys: pytest.CaptureFixture[str]) -> None:
    terminal("gs-c20", status=2)
    assert "did you mean gs-c200?" in capsys.readouterr().err
    terminal("gs-c200", "--address", "2", status=2)
    assert "without PORT" in capsys.readouterr().err


def completed(model: str, text: str) -> set[str]:
    return {word.spelling for word in fits(words(model), text)[1]}


def test_what_may_be_meant_is_what_begins_so() -> None:
    assert completed("gs-c200s", "P") >= {"Po", "Px"}
    assert completed("gs-c200s", "V1") == set()
    assert completed("supersigma", "st") == {"status", "stop"}
    assert completed("bs0610", "X100") >= {"G", "S", "I"}  # commands follow one another there
    assert fits(words("dcb-274"), "  Z")[0] == "Z"


def test_the_help_line_is_of_the_command_that_is_being_typed() -> None:
    assert explained(words("gs-c200s"), "V1").startswith("Vx: Read back the position")
    assert explained(words("gs-c200s"), "jc3,").startswith("jcy,xxx: ")
    assert explained(words("bs0610"), "X1000G").startswith("G: Go to a position")
    assert explained(words("supersigma"), "move +5").startswith("move")
    assert explained(words("gs-c200"), "") == "Tab: the commands"
    assert explained(words("bs0610"), "12") == "Tab: the commands"


@pytest.mark.parametrize("then", ["Z", "ESC"])
def test_a_program_is_heard_before_the_next_line_of_a_pipe_unless_that_cuts_in(
    then: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(f"P 0\n+ 10\nW 0\nZ\nJ 0 2\nP\nG 0\n{then}\n"))
    with served("dcb-274") as service:
        terminal("dcb-274", address(service), "--patience", "2")
    out = capsys.readouterr().out
    assert ("| 10\n| 20\n| 30\n< (the program has ended)\n" in out) is (then == "Z")
    assert ("<  (started)\n> ESC\n" in out) is (then == "ESC")
    assert "\n| \n" not in out


def test_what_nobody_asked_for_is_shown_while_nothing_is_typed(
    keys: PipeInput, capsys: pytest.CaptureFixture[str]
) -> None:
    class Port:
        def __init__(self) -> None:
            self.came, self.heard = [b"", b"     12\r\n", b""], threading.Event()

        def turn(self) -> nullcontext[None]:
            return nullcontext()

        def receive(self, timeout: float) -> bytes:
            data = self.came.pop(0) if self.came else b""
            if not self.came:
                self.heard.set()
                keys.send_text("Z\r\x04")
            return data

    class Unit:
        port = Port()

    session = prompt("dcb-274", words("dcb-274"))
    assert list(_typed(session, Unit(), json=False)) == ["Z"]  # type: ignore[arg-type]
    assert Unit.port.heard.is_set()
