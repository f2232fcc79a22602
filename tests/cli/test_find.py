import json
from pathlib import Path

import pytest
from tests.realtime.served import address, served

from detent.cli import main
from detent.realtime.connect import connect
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.finding import Listed


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine with much to do answers late, and is found all the same."""
    monkeypatch.setattr("detent.realtime.finding.PATIENCE", 5.0)


def run(*words: object, status: int = 0) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["find", *map(str, words)])
    assert ended.value.code == status


@pytest.mark.usefixtures("patient")
def test_what_is_found_comes_with_the_line_to_go_on_with(capsys: pytest.CaptureFixture[str]) -> None:
    with served("gs-c200s", straps={"CHS": "low"}) as service:
        run(address(service), "--model", "gs-c200")
        port = address(service)
    assert capsys.readouterr().out == (
        f"{port}: gs-c200s, no checksums: ready, at 0\n    detent terminal gs-c200s {port} --no-checksum\n"
    )


@pytest.mark.usefixtures("patient")
def test_every_family_is_found_where_none_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with served("dcb-274") as single, served("bs0610") as board:
        run(address(single), address(board), "--json")
    told = json.loads(capsys.readouterr().out)
    axis, motors = told["found"]
    assert [(port["port"], port["error"]) for port in told["looked_at"]] == [
        (axis["port"], None),
        (motors["port"], None),
    ]
    assert set(told["looked_for"]) == {"gs-c200", "dcb-274", "bs0610"}
    assert (axis["model"], axis["format"], axis["terminal"]) == (
        "dcb-274", None, f"detent terminal dcb-274 {axis['port']}",
    )  # fmt: skip
    assert (motors["model"], motors["says"]) == ("bs0610", "GenStepper $version: 2.18$")


def test_drives_are_found_on_request(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("detent.hosts.finding.DRIVES", range(5, 9))
    with served("supersigma", options={"number": "7"}) as service:
        run(address(service), "--model", "supersigma")
    assert "supersigma, drive 7: at rest, 0 steps" in (out := capsys.readouterr().out)
    assert out.endswith("--drive 7\n")


@pytest.mark.usefixtures("patient")
def test_the_ports_of_the_computer_are_looked_at_if_none_is_named(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with served("gs-c200") as service:
        ports = [Listed(address(service), "FTDI FT232R"), Listed("/dev/no-such-device", "")]
        monkeypatch.setattr("detent.realtime.finding.listed", lambda: ports)
        run("--model", "gs-c200")
        out, err = capsys.readouterr()
        assert out.startswith(f"{address(service)} (FTDI FT232R): gs-c200: ready, at 0\n")
        assert "/dev/no-such-device cannot be opened" in err  # and the others are looked at all the same
    monkeypatch.setattr("detent.realtime.finding.listed", list)
    run(status=1)
    assert "this computer has no serial ports; name one" in capsys.readouterr().err


def test_a_port_that_another_client_has_is_told_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with (
        served("gs-c200", endpoints=[EndpointSpec("tcp", "127.0.0.1:0")]) as service,
        connect("gs-c200", address(service)) as unit,
    ):
        unit.position()
        run(address(service), "--model", "gs-c200", status=1)
    out, err = capsys.readouterr()
    assert out == ""
    assert err.endswith("the other end closed it; it may serve one client at a time, and have one\n")
    assert err.count("\n") == 1


def test_a_port_that_is_not_there_is_told_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    run("/dev/no-such-device", status=1)
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("detent: /dev/no-such-device cannot be opened: there is no such device")


def test_where_nobody_answers_it_ends_with_1(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with served("supersigma") as service:
        run(address(service), "--model", "bs0610", status=1)
    assert capsys.readouterr().out.startswith("Nothing was found at ")


@pytest.mark.parametrize(
    ("words", "remedy"),
    [
        (("/dev/x", "--model", "gs-c20"), "did you mean gs-c200?"),
        (("/dev/x", "--baud", "77"), "none of these controllers talks at 77 baud"),
        (("/dev/x", "--model", "supersigma", "--model", "gs-c200"), "a SUPERSIGMA is looked for alone"),
        (("rfc2217://box",), "no HOST:PORT"),
    ],
)
def test_what_cannot_be_looked_for_is_asked_wrongly(
    words: tuple[str, ...], remedy: str, capsys: pytest.CaptureFixture[str]
) -> None:
    run(*words, status=2)
    assert remedy in capsys.readouterr().err
