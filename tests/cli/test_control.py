import contextlib
import json
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.cli.test_serve import ask, end, facts, start
from tests.realtime.controlled import controlled, slide

from detent.cli import control as verb
from detent.cli import main
from detent.cli.control import placed, usage
from detent.realtime import verbs
from detent.realtime.endpoints.tcp import TcpAddress
from detent.realtime.http import HttpControl
from detent.realtime.verbs import AskedWrongly

TOKEN = "a secret"


@pytest.fixture
def url() -> Iterator[str]:
    with controlled(slide()) as control:
        http = HttpControl(control, TcpAddress("127.0.0.1", 0))
        yield http.url
        http.close()


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    capsys.readouterr()
    status: Any = 0
    try:
        main(["control", *words])
    except SystemExit as ended:
        status = ended.code
    out, err = capsys.readouterr()
    return int(status or 0), out, err


def told(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    status, out, err = run(capsys, *words, "--json")
    assert (status, err) == (0, "")
    found: dict[str, Any] = json.loads(out)
    return found


def test_without_a_verb_the_state_is_shown(url: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, url)
    assert status == 0
    for text in ("slide", "gs-c200s", "ready", "9600 7O2", "switches: sensor 1, hand 1", "free"):
        assert text in out


def test_a_cell_is_broken_and_mended_from_the_command_line(url: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, url, "faults")[1] == "Nothing is broken.\n"
    run(capsys, url, "pause")
    assert told(capsys, url, "fault", "slide", "bit-errors", "--rate", "0.25", "--towards=units")["fault"] == 1
    assert "fault 2" in run(capsys, url, "fault", "sensor", "stuck", "--level", "low", "--for", "20 ms")[1]
    _, out, _ = run(capsys, url, "faults")
    assert "bit-errors" in out
    assert "rate 0.25" in out
    assert "0 of 0" in out
    assert "sensor 0 (stuck)" in run(capsys, url)[1]
    assert "yes" in run(capsys, url, "pins", "slide")[1]
    journal = run(capsys, url, "journal")[1]
    assert "Break  OnLine line 0, BitErrors towards units, rate 0.25" in journal
    assert "mended 1, 2" in run(capsys, url, "mend")[1]


def test_a_command_line_is_typed_and_waited_for(url: str, capsys: pytest.CaptureFixture[str]) -> None:
    run(capsys, url, "pause")
    run(capsys, url, "type", "+1000", "--unit", "slide")
    found = told(capsys, url, "wait", "--unit", "slide", "--position", "417", "--resume", "on", "--pause", "on")
    assert found["reached"] is True
    assert told(capsys, url)["units"]["slide"]["axes"][""]["position"] == 417


def test_what_does_not_come_in_time_ends_with_1(url: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, url, "wait", "--unit", "slide", "--position", "-5", "--timeout", "1 ms")
    assert status == 1
    assert out.startswith("It has not come to that in time.")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("fualt",), "no verb 'fualt'; did you mean fault?"),
        (("fault", "slide", "lots"), "no kind of fault 'lots'; did you mean lost?"),
        (("pins", "slid"), "no unit 'slid'; did you mean slide?"),
        (("set", "slide.UI7", "low"), "no input of slide 'UI7'; did you mean UI"),
        (("set", "slide.UI3", "middle"), "set: level cannot be 'middle'; it takes 0, 1, low or high"),
        (("fault", "slide", "lost", "--ntth", "1"), "no argument of fault 'ntth'; did you mean nth?"),
        (("fault", "slide", "lost", "--nth"), "--nth lacks its value; write --nth VALUE"),
        (("pause", "now"), "pause: 'now' is too much; it takes only --NAME VALUE"),
        (("switch", "hand"), "switch: level is missing"),
    ],
)
def test_a_wrong_request_is_answered_in_one_line_with_a_remedy(
    url: str, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], says: str
) -> None:
    status, out, err = run(capsys, url, *words)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert says in err


def test_a_url_that_is_none_is_explained(capsys: pytest.CaptureFixture[str]) -> None:
    for wrong in ("nowhere", "http://127.0.0.1", "ftp://127.0.0.1:21", "http://[::1:80"):
        status, _, err = run(capsys, wrong, "state")
        assert status == 2
        assert "write it like http://127.0.0.1:8400" in err


def test_a_service_that_does_not_answer_is_a_failure(url: str, capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = run(capsys, "http://127.0.0.1:1", "state")
    assert status == 1
    assert "does not answer: Connection refused; start it with detent serve TARGET --control 127.0.0.1:1" in err


def test_the_token_is_given_by_option_or_environment(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with controlled(slide()) as control:
        http = HttpControl(control, TcpAddress("127.0.0.1", 0), TOKEN)
        monkeypatch.delenv("DETENT_TOKEN", raising=False)
        status, _, err = run(capsys, http.url, "faults")
        assert (status, "a token is needed" in err) == (2, True)
        assert run(capsys, http.url, "faults", "--token", TOKEN)[0] == 0
        monkeypatch.setenv("DETENT_TOKEN", TOKEN)
        assert run(capsys, http.url, "faults")[0] == 0
        http.close()


def test_help_of_a_verb_tells_its_arguments(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(capsys, "http://127.0.0.1:1", "help", "switch")
    assert "0, 1, low or high" in out
    assert "resume" not in out
    assert "cable-out" in run(capsys, "http://127.0.0.1:1", "help", "fault")[1]
    assert told(capsys, "http://127.0.0.1:1", "help", "switch") == {"switch": ["switch", "level"]}
    status, _, err = run(capsys, "http://127.0.0.1:1", "help", "swich")
    assert status == 2
    assert "did you mean switch?" in err


def test_help_lists_every_verb_and_every_fault(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run(capsys, "http://127.0.0.1:1", "help")
    for name in (*verbs.VERBS, *verbs.FAULTS):
        assert name in out
    assert set(told(capsys, "http://127.0.0.1:1", "help")) == set(verbs.VERBS)


@pytest.mark.parametrize(
    ("verb", "words", "given"),
    [
        ("fault", ["a", "lost", "--nth", "3"], {"where": "a", "kind": "lost", "nth": "3"}),
        ("fault", ["--nth=3", "a", "lost"], {"where": "a", "kind": "lost", "nth": "3"}),
        ("fault", ["--kind", "lost", "a"], {"where": "a", "kind": "lost"}),
        ("type", ["A", "B"], {"text": "A B"}),
        ("type", ["--", "--5"], {"text": "--5"}),
        ("type", ["-5"], {"text": "-5"}),
        ("pins", [], {}),
    ],
)
def test_arguments_go_by_place_or_by_name(verb: str, words: list[str], given: dict[str, str]) -> None:
    assert placed(verbs.verb(verb), words) == given


def test_what_is_too_much_is_named() -> None:
    with pytest.raises(AskedWrongly, match=r"switch: 'c' is too much; it takes SWITCH LEVEL"):
        placed(verbs.verb("switch"), ["a", "b", "c"])


def test_usage_tells_what_may_be_left_out() -> None:
    assert usage(verbs.verb("power")) == "ON [UNIT]"
    assert usage(verbs.verb("send")) == "DATA [--line]"


def test_serve_opens_it_and_tells_where(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    served = start("gs-c200", "--strap", "CHS=low", "--state", tmp_path, "--control", "127.0.0.1:0", "--json")
    ready = facts(served)
    told(capsys, ready["control"], "fault", "line", "bit-errors", "--nth", "1", "--towards", "units")
    assert ask(ready["endpoints"][0]["address"], b"V1\r") == b"E1\r"
    end(served)


def test_serve_tells_people_how_to_use_it(tmp_path: Path) -> None:
    served = start("gs-c200", "--state", tmp_path, "--control", ":0")
    assert served.stdout is not None
    lines = []
    while not lines or "Ctrl-C" not in lines[-1]:
        lines.append(served.stdout.readline())
        assert lines[-1], served.communicate()[1]
    assert any(line.startswith("  detent control http://127.0.0.1:") for line in lines)
    end(served)


@pytest.mark.parametrize(
    ("address", "says"),
    [
        ("8400", "--control: '8400' is no HOST:PORT; write 127.0.0.1:4001"),
        ("0.0.0.0:0", "0.0.0.0:0 is open to other computers: give --token TEXT or $DETENT_TOKEN, or listen on 127"),
    ],
)
def test_serve_refuses_what_is_open_to_everybody(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], address: str, says: str
) -> None:
    monkeypatch.delenv("DETENT_TOKEN", raising=False)
    with pytest.raises(SystemExit) as exited:
        main(["serve", "gs-c200", "--state", str(tmp_path), "--control", address])
    assert exited.value.code == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize("token", ["a\nb", "日本語日本語日本語", "some\udcffwhere"])
def test_a_token_that_no_request_can_carry_is_told_as_such(
    url: str, token: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status, _, err = run(capsys, url, "--token", token)
    assert status == 2
    assert err == "detent: the token has characters that no request can have; give the one of serve\n"


# -- who is no service ---------------------------------------------------------------------------------------------

HEAD = b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n"
STRANGERS = {
    "is silent": [],
    "speaks a byte at a time": [HEAD + b"Content-Length: 9999\r\n\r\n", *[b"["] * 9999],
    "never ends its head": [HEAD, *[b"x"] * 9999],
    "has no end": [HEAD + b"\r\n", *[b"[" * 65_536] * 99],
    "nests": [HEAD + b"Content-Length: 90000\r\n\r\n", b"[" * 90_000],
    "tells something else": [HEAD + b'Content-Length: 12\r\n\r\n{"units": 5}'],
    "tells less": [HEAD + b'Content-Length: 13\r\n\r\n{"units": {}}'],
    "leads elsewhere": [b"HTTP/1.1 302 Found\r\nLocation: file:///etc/hosts\r\nContent-Length: 0\r\n\r\n"],
    "is no server": [b"\xff\x00GARBAGE\r\n\r\n"],
    "leaves": [b""],
}


@pytest.mark.parametrize("stranger", STRANGERS)
def test_whoever_answers_the_end_is_near_and_a_line(
    stranger: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(verb, "LONGER", 1.0)
    monkeypatch.setattr(verb, "MOST_ANSWER", 1 << 20)
    gone = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            client, _ = server.accept()
            with client, contextlib.suppress(OSError):
                client.recv(4096)
                for piece in STRANGERS[stranger]:
                    client.sendall(piece)
                    if len(piece) == 1:
                        gone.wait(0.01)
                if stranger != "leaves":
                    gone.wait(180)

        thread = threading.Thread(target=answer)
        thread.start()
        status, out, err = run(capsys, f"http://127.0.0.1:{server.getsockname()[1]}")
        gone.set()
        thread.join()
    assert (status, out) == (1, "")
    assert err.startswith("detent: http://127.0.0.1:")
    assert err.count("\n") == 1
