import io
import json
import os
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from tests.realtime.served import address, served

from detent.cli import main
from detent.hosts.backups import Backup, BackupError
from detent.hosts.errors import DriverError
from detent.hosts.gsc200 import BlockingGsC200
from detent.realtime.connect import connect

pytestmark = pytest.mark.waits


@pytest.fixture(autouse=True)
def state(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state"


def run(*words: object, status: int = 0) -> None:
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in words])
    assert ended.value.code == status


def test_a_module_comes_back_as_it_was(tmp_path: Path, capsys: pytest.CaptureFixture[str], state: Path) -> None:
    file = tmp_path / "drill.toml"
    with served("gs-c200s") as service:
        port = address(service)
        with connect("gs-c200s", port) as unit:
            unit.write_program(["A1", "+100", "jc3,0"])
            unit.save()
        run("backup", "gs-c200s", port, file)
        assert f"Wrote {file}: model gs-c200s, memory EEPROM, program of 3 lines" in capsys.readouterr().out
        text = file.read_text()
        assert '    "+100",  # Move by a number of steps.\n' in text
        assert tomllib.loads(text)["saved"]["program"] == ["A1", "+100", "jc3,0"]

        run("restore", "gs-c200s", port, file, "--yes")
        assert capsys.readouterr().out == "nothing differs: the unit holds what the file says\n"
        with connect("gs-c200s", port) as unit:
            unit.write_program(["C1"])
            unit.save()
        run("restore", "gs-c200s", port, file, "--yes", "--json")
        told: dict[str, Any] = json.loads(capsys.readouterr().out)
        assert '-    "C1",' in told["differences"]
        assert '+    "+100",' in told["differences"]
        assert told["told"][0].startswith("The EEPROM holds the program of 3 instructions, read back and right")
        assert Path(told["before"]).parent == state / "detent" / "before-restore"
        assert Backup.parse(Path(told["before"]).read_text()).saved["program"] == ["C1"]
        run("backup", "gs-c200s", port, tmp_path / "again.toml", "--json")
        assert json.loads(capsys.readouterr().out)["saved"]["program"] == ["A1", "+100", "jc3,0"]


def test_a_dcb_274_comes_back_byte_for_byte(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "axis.toml"
    with served("dcb-274") as service:
        port = address(service)
        run("backup", "dcb-274", port, file, "--patience", 1)
        with connect("dcb-274", port, patience=1.0) as unit:
            before = unit.read_memory(0, 255)
            unit.write_program(["R 5000", "W 0"])
        run("restore", "dcb-274", port, file, "--yes", "--patience", 1)
        with connect("dcb-274", port, patience=1.0) as unit:
            assert unit.read_memory(0, 255) == before
    assert re.search(r"^read back \d+ bytes: as in the backup$", capsys.readouterr().out, re.MULTILINE)
    text = file.read_text()
    assert '    "+ 1001",  # Move in plus direction.' in text
    assert "# What is written back is memory, bytes with their addresses; the rest is there to be read." in text
    assert re.search(r'^    "eb e9 03 00 .*",  # 0$', text, re.MULTILINE)
    assert re.search(r'^    "ff .*",  # 2032$', text, re.MULTILINE)


def test_the_settings_of_a_board_fit_both_boards(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "board.toml"
    with served("bs0610") as service:
        run("backup", "bs0610", address(service), file)
        file.write_text(file.read_text().replace("run_rate = 800", "run_rate = 900"))
        run("restore", "bs0710", address(service), file, "--yes")
    assert "X.run_rate is 900." in capsys.readouterr().out


def answered(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    class Keyboard(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setattr(sys, "stdin", Keyboard(text))


def test_people_see_what_differs_and_are_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "drill.toml"
    file.write_text(Backup("gs-c200s", {"model": "gs-c200s", "program": ["A1", "C1"]}).text())
    with served("gs-c200s") as service:
        answered(monkeypatch, "n\n")
        run("restore", "gs-c200s", address(service), file, status=1)
        out, err = capsys.readouterr()
        assert '+    "A1",' in out
        assert err == "detent: nothing was written\n"
        with connect("gs-c200s", address(service)) as unit:
            assert unit.read_program() == []
        answered(monkeypatch, "y\n")
        run("restore", "gs-c200s", address(service), file)
        assert "read back and right" in capsys.readouterr().out
        monkeypatch.setattr(sys, "stdin", io.StringIO())
        file.write_text(file.read_text().replace("C1", "C2"))
        run("restore", "gs-c200s", address(service), file, status=2)
        out, err = capsys.readouterr()
        assert '+    "C2",' in out
        assert "say --yes" in err


def test_a_restore_that_fails_half_way_says_what_is_where_and_loses_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, state: Path
) -> None:
    def fails(self: BlockingGsC200) -> None:
        raise DriverError("GS-C200S", "does not answer M")

    file = tmp_path / "drill.toml"
    with served("gs-c200s") as service:
        with connect("gs-c200s", address(service)) as unit:
            unit.write_program(["C1"])
            unit.save()
        run("backup", "gs-c200s", address(service), file)
        file.write_text(file.read_text().replace('"C1"', '"A1"'))
        monkeypatch.setattr("detent.hosts.gsc200.GsC200.save", fails)
        run("restore", "gs-c200s", address(service), file, "--yes", status=1)
    err = capsys.readouterr().err
    assert "the EEPROM may hold neither program. The EEPROM held the program C1" in err
    (kept,) = (state / "detent" / "before-restore").iterdir()
    assert f"what the unit held before is in {kept}" in err
    assert Backup.parse(kept.read_text()).saved["program"] == ["C1"]


def test_a_restore_that_is_interrupted_names_both_files_and_can_be_done_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, state: Path
) -> None:
    def interrupted(self: BlockingGsC200) -> None:
        raise KeyboardInterrupt

    file = tmp_path / "drill.toml"
    with served("gs-c200s") as service:
        with connect("gs-c200s", address(service)) as unit:
            unit.write_program(["C1"])
            unit.save()
        run("backup", "gs-c200s", address(service), file)
        file.write_text(file.read_text().replace('"C1"', '"A1"'))
        with monkeypatch.context() as patched:
            patched.setattr("detent.hosts.gsc200.GsC200.leave_programming", interrupted)  # stored, and not yet saved
            run("restore", "gs-c200s", address(service), file, "--yes", status=130)
        (kept,) = (state / "detent" / "before-restore").iterdir()
        err = capsys.readouterr().err
        assert err.count("\n") == 1
        assert f"the unit may hold part of {file}" in err
        assert f"detent restore gs-c200s {address(service)} {kept} what it held before" in err
        # the module is still in programming mode, where X is "not allowed" (E4)
        run("restore", "gs-c200s", address(service), kept, "--yes")
        run("backup", "gs-c200s", address(service), file, "--overwrite")
    assert Backup.parse(file.read_text()).saved["program"] == ["C1"]
    assert "ram" not in Backup.parse(file.read_text()).saved


def test_a_gs_c200_in_programming_mode_says_how_to_leave_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "drill.toml"
    with served("gs-c200") as service:
        run("backup", "gs-c200", address(service), file)
        with connect("gs-c200", address(service)) as unit:
            unit.write_program(["C1"])
        run("restore", "gs-c200", address(service), file, "--yes", status=1)
    assert "programming mode, which a GS-C200 leaves only by E (execute() in Python)" in capsys.readouterr().err


def test_a_line_that_is_none_of_the_models_is_found_before_anything_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "drill.toml"
    file.write_text(Backup("gs-c200", {"program": ["A9"]}).text())
    with served("gs-c200") as service:
        run("restore", "gs-c200", address(service), file, "--yes", status=2)
    assert f"detent: {file}: program: line 1: 'A9': the number must be 1 to 3" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "model", "remedy"),
    [
        ("model = ", "gs-c200", "it is no TOML"),
        ("[units.x]\n", "gs-c200", 'those begin with format = "detent backup 1"'),
        ('format = "detent backup 1"\n', "gs-c200", "model and [saved] must be there"),
        (Backup("dcb-274", {}).text(), "gs-c200", "it is the backup of a dcb-274, and this is a gs-c200"),
        (Backup("gs-c200s", {}).text(), "gs-c200", "it is the backup of a gs-c200s, and this is a gs-c200"),
        ("", "supersigma", "burnt into its EPROM"),
        ("", "gs-c20", "did you mean gs-c200?"),
    ],
)
def test_a_file_that_is_not_for_the_unit_is_refused_before_anything_is_sent(
    text: str, model: str, remedy: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "backup.toml"
    file.write_text(text)
    run("restore", model, "/dev/no-such-device", file, "--yes", status=2)
    assert remedy in capsys.readouterr().err


def test_files_that_cannot_be_read_or_written_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("restore", "gs-c200", "/dev/no-such-device", tmp_path / "none.toml", "--yes", status=2)
    assert "none.toml: cannot read it: No such file" in capsys.readouterr().err
    (tmp_path / "picture.toml").write_bytes(os.urandom(64) + b"\xff\xfe")
    run("restore", "gs-c200", "/dev/no-such-device", tmp_path / "picture.toml", "--yes", status=2)
    assert "it is no text file" in capsys.readouterr().err
    with served("gs-c200") as service:
        run("backup", "gs-c200", address(service), tmp_path, status=1)
    assert f"{tmp_path}: not written" in capsys.readouterr().err


def test_a_second_backup_keeps_the_first_and_both_say_how_they_go_back(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "unit.toml"
    file.write_text("mine")
    with served("gs-c200", straps={"CHS": "low"}) as service:
        unit = ("gs-c200", address(service), file, "--no-checksum", "--baud", 9600)
        run("backup", *unit)
        run("backup", *unit, "--json")
        out, err = capsys.readouterr()
        assert file.read_text() == "mine"
        assert f"{file} is there and is kept; --overwrite writes over it" in err
        assert json.loads(out.splitlines()[-1])["file"] == str(tmp_path / "unit-3.toml")
        text = (tmp_path / "unit-2.toml").read_text()
        assert "detent restore gs-c200 PORT FILE --no-checksum --baud 9600\n" in text
        run("backup", *unit, "--overwrite")
    assert Backup.parse(file.read_text()).model == "gs-c200"
    assert sorted(path.name for path in tmp_path.glob("unit*")) == ["unit-2.toml", "unit-3.toml", "unit.toml"]


def test_a_backup_is_toml_whatever_it_holds() -> None:
    saved = {
        "text": 'quote " backslash \\ tab \t bell \x07 del \x7f é',
        "numbers": [1, -2],
        "odd key.": True,
        "rate": 2.5,
        "empty": [],
        "X": {"run": 1, "deep": {"er": "yes"}},
    }
    assert Backup.parse(Backup("bs0610", saved, "a note").text()).saved == saved
    with pytest.raises(ValueError, match="has no place in a backup"):
        Backup("bs0610", {"none": None}).text()
    with pytest.raises(BackupError, match="it is no TOML"):
        Backup.parse("=")
