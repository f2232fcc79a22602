"""The verb `service`: the unit is sound for systemd, and says what will not go well."""

import os
import shutil
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from detent.cell.description import Problem
from detent.cli import main, serve
from detent.realtime.boards.opening import NotYet
from detent.realtime.endpoints.endpoint import EndpointError
from detent.realtime.notify import Notifier

EXAMPLES = Path(__file__).parents[2] / "examples"
BY_ID = "/dev/serial/by-id"


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    status: object = 0
    try:
        main(words)
    except SystemExit as end:
        status = end.code
    told = capsys.readouterr()
    return int(str(status or 0)), told.out, told.err


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    """A cell with by-id names, in a folder that has to be quoted."""
    folder = tmp_path / "a 100% machine's $cell"
    shutil.copytree(EXAMPLES / "replacement", folder)
    path = folder / "pico-gs-c200.toml"
    text = (
        path.read_text()
        .replace('"fake:rp2040"', f'"{BY_ID}/usb-Klipper_rp2040_1-if00"')
        .replace("# endpoint", "endpoint")
    )
    path.write_text(text)
    return path


def test_the_unit_is_what_a_service_needs(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, "service", str(cell), "--user", "detent", "--control", "127.0.0.1:8400")
    assert (status, err) == (0, "")
    lines = out.splitlines()
    for line in (
        "Type=notify", "WatchdogSec=5", "Restart=on-failure", "StateDirectory=detent-pico-gs-c200", "User=detent",
        "LimitRTPRIO=95", "TimeoutStartSec=infinity", "WantedBy=multi-user.target",
    ):  # fmt: skip
        assert line in lines
    command = next(line for line in lines if line.startswith("ExecStart="))
    assert command.endswith("--wait --real --realtime --control 127.0.0.1:8400 --state %S/detent-pico-gs-c200")
    assert "a 100%% machine's $$cell" in command


def verify(place: Path) -> subprocess.CompletedProcess[str]:
    words = ["systemd-analyze", "verify", "--man=no", str(place)]
    return subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not here")
def test_systemd_finds_it_sound(cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = tmp_path / "detent-slide.service"
    status, _, err = run(capsys, "service", str(cell), "--user", "daemon", "--output", str(place))
    assert (status, err) == (0, "")
    done = verify(place)
    told = [line for line in done.stderr.splitlines() if place.name in line]
    assert (done.returncode, told) == (0, []), done.stderr
    wrong = tmp_path / "detent-wrong.service"  # proves that it looks at all
    wrong.write_text(place.read_text().replace(sys.executable, "/no/such/python"))
    assert "/no/such/python" in verify(wrong).stderr


def test_a_file_is_never_written_over_unasked(cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = tmp_path / "x.service"
    place.write_text("mine")
    status, out, err = run(capsys, "service", str(cell), "--user", "a", "--output", str(place))
    assert (status, out, place.read_text()) == (2, "", "mine")
    assert "is there: write to another file, or over it with --overwrite" in err
    status, out, _ = run(capsys, "service", str(cell), "--user", "a", "--output", str(place), "--overwrite")
    assert status == 0
    assert "sudo systemctl enable --now detent-pico-gs-c200" in out
    assert place.read_text().startswith("# Made by `detent service pico-gs-c200.toml`")


def test_what_will_not_go_well_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell = tmp_path / "cell.toml"
    text = (EXAMPLES / "replacement" / "printer-board-gs-c200.toml").read_text()
    cell.write_text(text)
    status, _, err = run(capsys, "service", str(cell), "--user", "root")
    assert status == 0
    assert "boards.skr.serial: fake:stm32 drives no pin" in err
    assert "no line says where its host is" in err
    assert "it will run as root" in err
    cell.write_text(text.replace("fake:stm32", "/dev/ttyACM0"))
    assert (
        "boards.skr.serial: /dev/ttyACM0 may be another device at the next start"
        in run(capsys, "service", str(cell))[2]
    )


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (("gs-c200",), "gs-c200 is no cell file"),
        (("CELL", "--name", "a/b"), "--name: 'a/b'"),
        (("CELL", "--user", "a b"), "--user: 'a b'"),
        (("CELL", "--control", "8400"), "--control"),
        (("nothing.toml",), "nothing.toml: cannot read it"),
    ],
)
def test_asked_wrongly(words: tuple[str, ...], error: str, cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = run(capsys, "service", *(str(cell) if word == "CELL" else word for word in words))
    assert (status, out) == (2, "")
    assert error in err
    assert err.count("\n") == 1


def test_what_may_pass_is_waited_for_and_told_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """At power-on a board boots, a driver has no supply yet, a port has no owner: nothing for which a box gives up."""
    attempts: list[Exception | str] = [
        NotYet("cell.toml", "boards.b.serial", "it does not answer"),
        NotYet("cell.toml", "boards.b.serial", "it does not answer"),
        EndpointError("/dev/ttyS0 cannot be opened: Permission denied"),
        NotYet("cell.toml", "boards.b.serial", "it does not answer"),
        "served",
    ]
    slept: list[float] = []
    monkeypatch.setattr("time.sleep", slept.append)

    def opened() -> object:
        found = attempts.pop(0)
        if isinstance(found, Exception):
            raise found
        return found

    assert serve._wait({}, opened, Notifier({})) == "served"  # type: ignore[arg-type,comparison-overlap]
    told = capsys.readouterr().err.splitlines()
    assert told == [
        "detent: cell.toml: boards.b.serial: it does not answer; trying again",
        "detent: /dev/ttyS0 cannot be opened: Permission denied; trying again",
    ]
    assert len(slept) == 4


def test_what_no_waiting_mends_ends_it() -> None:
    def opened() -> object:
        raise Problem("cell.toml", "hardware.x.step", "the board has no pin gpio99")

    with pytest.raises(Problem, match="gpio99"):
        serve._wait({}, opened, Notifier({}))  # type: ignore[arg-type]


def test_one_that_waits_is_ended_without_a_failure(
    cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [sys.executable, "-m", "detent", "serve", str(cell), "--real", "--wait", "--state", str(tmp_path / "state")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as served:
        assert served.stderr is not None
        told = served.stderr.readline()
        served.send_signal(signal.SIGTERM)
        assert served.wait(60) == 143
        assert served.stderr.read() == ""
    assert f"waiting for {BY_ID}/usb-Klipper_rp2040_1-if00 (boards.pico.serial)" in told
    assert "SuccessExitStatus=143" in run(capsys, "service", str(cell))[1].splitlines()


def test_serve_is_ready_is_alive_and_says_when_it_stops(tmp_path: Path) -> None:
    at = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    at.bind(str(tmp_path / "notify"))
    at.settimeout(60)
    environment = {**os.environ, "NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "2000000"}
    cell = EXAMPLES / "replacement" / "printer-board-gs-c200.toml"
    words = [sys.executable, "-m", "detent", "serve", str(cell), "--real", "--wait", "--state", str(tmp_path / "state")]
    with at, subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as served:
        heard = [at.recv(4096).decode()]
        while "WATCHDOG=1" not in heard:
            heard.append(at.recv(4096).decode())
        served.send_signal(signal.SIGTERM)
        while heard[-1] != "STOPPING=1":
            heard.append(at.recv(4096).decode())
        assert served.wait(60) == 0
    assert heard[0] == "READY=1\nSTATUS=serving x, y"


@pytest.mark.parametrize(
    ("old", "new", "error"),
    [
        ('EOT = "^gpio10"', 'EOT = "gpio2"', "hardware.slide.inputs.EOT: pin gpio2 of pico is hardware.slide.step"),
        ('inputs.EOT = "^gpio10"', "", "hardware.slide.inputs: slide has no EOT: wire it"),
        ('eeprom = "slide.gsc"', 'eeprom = "none.gsc"', "none.gsc"),
        ('REC = "low"', 'RECC = "low"', "did you mean REC?"),
    ],
)
def test_no_unit_is_made_for_a_cell_that_cannot_be_served(
    old: str, new: str, error: str, cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """At power-on nobody would see why."""
    text = cell.read_text()
    assert old in text
    machine = "" if "[switches" not in text else text[text.index("[switches") :]
    cell.write_text(text.replace(machine, "").replace(old, new))
    status, out, err = run(capsys, "service", str(cell))
    assert (status, out) == (2, "")
    assert error in err
    assert err.count("\n") == 1
