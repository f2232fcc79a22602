import json
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from detent.cell.build import build
from detent.cell.description import parse
from detent.cell.real_pins import unreal
from detent.cli import main

COMMAND = [sys.executable, "-c", "from detent.cli import main; main()", "serve"]
TWO_LINES = '[units.bar]\nmodel = "gs-c200"\n[units.drill]\nmodel = "gs-c200s"\n'


def start(*choices: object) -> subprocess.Popen[str]:
    return subprocess.Popen([*COMMAND, *map(str, choices)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def facts(served: subprocess.Popen[str]) -> dict[str, Any]:
    assert served.stdout is not None
    line = served.stdout.readline()
    assert line, served.communicate()[1]
    found: dict[str, Any] = json.loads(line)
    return found


def end(served: subprocess.Popen[str], number: int = signal.SIGTERM) -> tuple[str, str]:
    """What is left on stdout and stderr after a signal."""
    served.send_signal(number)
    out, err = served.communicate(timeout=60)
    assert served.returncode == 0, err
    return out, err


def ask(address: str, text: bytes) -> bytes:
    """The answer to one frame at a pseudo-terminal or a port."""
    if address.startswith("/"):
        client = os.open(address, os.O_RDWR | os.O_NOCTTY)
        os.write(client, text)
        answer = b""
        while not answer.endswith(b"\r"):
            answer += os.read(client, 20)
        os.close(client)
        return answer
    host, _, port = address.rpartition(":")
    with socket.create_connection((host.strip("[]"), int(port))) as connected:
        connected.sendall(text)
        answer = b""
        while not answer.endswith(b"\r"):
            answer += connected.recv(20)
        return answer


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_served_controller_answers_until_a_signal_ends_it_cleanly(tmp_path: Path, number: int) -> None:
    link = tmp_path / "stepper"
    served = start(
        "gs-c200", "--pty", link, "--tcp", "127.0.0.1:0", "--state", tmp_path, "--strap", "CHS=low", "--json"
    )
    found = facts(served)
    assert found["control"] is None
    assert [(e["unit"], e["kind"]) for e in found["endpoints"]] == [("gs-c200", "pty"), ("gs-c200", "tcp")]
    assert found["endpoints"][0]["address"] == str(link)
    for endpoint in found["endpoints"]:
        assert ask(endpoint["address"], b"F\r") == b"R\r"
    assert end(served, number) == ("", "")
    assert [path.name for path in tmp_path.iterdir()] == ["gs-c200.lock"]
    host, _, port = found["endpoints"][1]["address"].rpartition(":")
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((host, int(port)))


def test_a_program_stored_by_one_process_is_found_by_the_next(tmp_path: Path) -> None:
    choices = ("gs-c200", "--no-line-timing", "--state", tmp_path, "--strap", "CHS=low", "--json")
    served = start(*choices)
    address = facts(served)["endpoints"][0]["address"]
    for command in (b"P\r", b"A1\r", b"C1\r", b"M\r"):
        assert ask(address, command) == b"Y\r"
    served.kill()  # not even a crash loses what was stored
    served.communicate()
    served = start(*choices)
    address = facts(served)["endpoints"][0]["address"]
    assert ask(address, b"X\r") == b"Y\r"
    assert ask(address, b"Q\r").startswith(b"A1\r")
    end(served)


def test_two_processes_do_not_share_images(tmp_path: Path) -> None:
    first = start("gs-c200", "--state", tmp_path, "--json")
    facts(first)
    second = start("gs-c200", "--state", tmp_path, "--json")
    out, err = second.communicate(timeout=60)
    assert (second.returncode, out) == (2, "")
    assert re.fullmatch(r"detent: .*/gs-c200\.lock is locked: .*--state DIR\n", err)
    end(first)


def test_people_are_told_what_is_served_and_how_to_connect(tmp_path: Path) -> None:
    served = start("gs-c200", "--pty", "--tcp", ":0", "--rfc2217", ":0", "--state", tmp_path, "--strap", "BR0=high")
    assert served.stdout is not None
    lines = []
    while not lines or "Ctrl-C" not in lines[-1]:
        lines.append(served.stdout.readline())
        assert lines[-1], served.communicate()[1]
    text = "".join(lines)
    assert re.search(r"^  gs-c200: gs-c200, straps .*\bBR0=1\b", text, re.M)
    assert re.search(r"^  gs-c200  picocom --baud 4800 /dev/\S+ +# pseudo-terminal, 4800 7O2$", text, re.M)
    assert re.search(r"; nc 127\.0\.0\.1 \d+; .*# TCP 127\.0\.0\.1:\d+, 4800 7O2$", text, re.M)
    url = r"rfc2217://127\.0\.0\.1:\d+"
    assert re.search(
        rf'  serial\.serial_for_url\("{url}", 4800, 7, "O", 2\) +# RFC 2217 \(pyserial\), 4800 7O2$', text, re.M
    )
    out, err = end(served)
    assert re.fullmatch(r"Ended after \S+ s: .*deadlines.*\.\n", out)
    assert err == ""


def test_every_line_of_a_cell_has_its_own_endpoint(tmp_path: Path) -> None:
    cell = tmp_path / "two.toml"
    cell.write_text(TWO_LINES)
    served = start(cell, "--tcp", "127.0.0.1:0", "--strap", "drill.CHS=low", "--state", tmp_path, "--json")
    bar, drill = facts(served)["endpoints"]
    assert (bar["unit"], drill["unit"]) == ("bar", "drill")
    assert ask(bar["address"], b"FV\r") == b"RR\r"
    assert ask(drill["address"], b"F\r") == b"R\r"
    end(served)


def test_a_damaged_image_is_reported_and_the_controller_starts(tmp_path: Path) -> None:
    (tmp_path / "gs-c200.gs-c200.eeprom").write_bytes(b"rubbish")
    served = start("gs-c200", "--state", tmp_path, "--json")
    assert facts(served)["endpoints"]
    _, err = end(served)
    assert "gs-c200.eeprom.damaged-1 now, and gs-c200 starts empty" in err


def test_what_follows_pty_may_be_what_is_to_be_served(tmp_path: Path) -> None:
    served = start("--state", tmp_path, "--json", "--pty", "gs-c200")
    assert [e["kind"] for e in facts(served)["endpoints"]] == ["pty"]
    end(served)


@pytest.mark.parametrize(
    ("choices", "says"),
    [
        ((), r"say what to serve: a model like gs-c200"),
        (("gs-c20",), r"did you mean gs-c200\?"),
        (("nowhere.toml",), r"nowhere\.toml: cannot read it: No such file"),
        (("gs-c200", "--strap", "CHS"), r"--strap: 'CHS': write NAME=VALUE"),
        (("gs-c200", "--strap", "CHX=1"), r"did you mean CHS\?"),
        (("gs-c200", "--strap", "CHS=2"), r"strap CHS cannot be '2'; it takes"),
        (("gs-c200", "--set", "revison=2"), r"did you mean revision\?"),
        (("gs-c200", "--pace", "0"), r"--pace: 0\.0 is no pace; it takes a number above 0"),
        (("gs-c200", "--pace", "inf"), r"--pace: inf is no pace"),
        (("gs-c200", "--tcp", "4001"), r"--tcp: '4001' is no HOST:PORT; write 127\.0\.0\.1:4001"),
        (("gs-c200", "--tcp", "192.0.2.1:0"), r"192\.0\.2\.1:0 cannot be listened on"),
        (("gs-c200", "--serial", "/dev/nothing"), r"/dev/nothing cannot be opened at 9600 7O2: No such file"),
        (("gs-c200", "--pty", "/nowhere/x"), r"/nowhere/x cannot be made: No such file or directory; choose"),
        (("gs-c200", "--pty", "/etc"), r"/etc exists and is not a symbolic link; remove it or choose"),
        (("gs-c200", "--state", "/dev/null/x"), r"cannot be kept in /dev/null/x: Not a directory; .*--state DIR"),
    ],
)
def test_a_wrong_request_is_answered_in_one_line_with_a_remedy(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    choices: tuple[str, ...],
    says: str,
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with pytest.raises(SystemExit) as exited:
        main(["serve", *choices])
    out, err = capsys.readouterr()
    assert exited.value.code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert re.search(says, err)


def test_a_port_that_is_taken_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(SystemExit) as exited:
            main(["serve", "gs-c200", "--tcp", f"127.0.0.1:{port}"])
    assert exited.value.code == 2
    assert f"127.0.0.1:{port} cannot be listened on: Address already in use; choose another" in capsys.readouterr().err


def test_several_lines_do_not_share_one_wire(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    cell = tmp_path / "two.toml"
    cell.write_text(TWO_LINES)
    with pytest.raises(SystemExit) as exited:
        main(["serve", str(cell), "--serial", "/dev/ttyS0"])
    assert exited.value.code == 2
    assert "one wire and the cell has several lines" in capsys.readouterr().err


REAL = """
[units.x]
model = "gs-c200"
straps = { CHS = "low" }
[boards.b]
serial = "fake:"
[hardware.x]
board = "b"
step = "!gpio2"
dir = "gpio3"
inputs = { EOT = "^gpio10", HOME = "^gpio11" }
"""


def test_a_cell_with_real_pins_is_served_behind_its_board(tmp_path: Path) -> None:
    cell = tmp_path / "cell.toml"
    cell.write_text(REAL)
    served = start(cell, "--real", "--realtime", "--json", "--state", tmp_path)
    told = facts(served)
    assert told["axes"] == ["x"]
    assert told["boards"][0]["board"] == "b"
    assert told["boards"][0]["state"] == "ready"
    assert ask(told["endpoints"][0]["address"], b"+5\r") == b"Y\r"
    end(served)


def test_real_pins_need_their_tables_and_real_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell = tmp_path / "cell.toml"
    cell.write_text(TWO_LINES)
    for choices, error in (
        ([cell, "--real"], "hardware: no pin of this cell is real: add [boards.NAME] and [hardware.UNIT]"),
        (["gs-c200", "--real", "--pace", "2"], "--pace: real pins keep real time: leave it out with --real"),
    ):
        with pytest.raises(SystemExit) as ended:
            main(["serve", *map(str, choices), "--state", str(tmp_path)])
        assert ended.value.code == 2
        assert error in capsys.readouterr().err


def test_what_of_a_cell_has_no_real_pins_is_said() -> None:
    """Nobody waits for a motor that is none: --real forgotten, a table left out, a board on which nothing hangs."""
    text = '[units.a]\nmodel = "gs-c200"\n[units.b]\nmodel = "gs-c200"\n'
    hung = (
        '[boards.one]\nserial = "fake:"\n[boards.two]\nserial = "fake:"\n[hardware.a]\nboard = "one"\nstep = "gpio2"\n'
        'dir = "gpio3"\nunwired = ["EOT", "HOME"]\n'
    )
    for cell, driven, said in (
        (text, True, []),
        (text + hung, False, ["No pin is driven: with --real the motors on one would move."]),
        (text + hung, True, ["Without real pins: b ([hardware.b] would give it some)", "Nothing hangs on two"]),
    ):
        described = parse(cell, "cell.toml")
        assert unreal(described, tuple(build(described, lambda name: "").controllers()), driven=driven) == said
