import json
from pathlib import Path

import pytest
from tests.realtime.served import address, served

from detent.cli import main
from detent.realtime.connect import connect

pytestmark = pytest.mark.waits

SOURCE = "; blinks\nagain: A1\n  D1 ; a tenth of a second\n  C1\n  j again\n"


def run(*words: object, status: int = 0) -> None:
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in words])
    assert ended.value.code == status


@pytest.fixture
def source(tmp_path: Path) -> Path:
    file = tmp_path / "blink.src"
    file.write_text(SOURCE)
    return file


def test_a_program_goes_up_with_its_labels_and_comes_back(
    source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with served("gs-c200s") as service:
        port = address(service)
        run("upload", "gs-c200s", port, source)
        assert capsys.readouterr().out == "Stored 4 instructions, 8 bytes, read them back\n"
        run("compare", "gs-c200s", port, source)
        assert capsys.readouterr().out == f"The unit holds {source}: 4 instructions\n"
        run("download", "gs-c200s", port)
        assert capsys.readouterr().out == "at_0:\nA1\nD1\nC1\nj at_0\n"
        run("download", "gs-c200s", port, tmp_path / "back.src")
        run("compare", "gs-c200s", port, tmp_path / "back.src")
        capsys.readouterr()
        run("download", "gs-c200s", port, "--json")
        assert json.loads(capsys.readouterr().out)["lines"] == ["A1", "D1", "C1", "j0"]


def test_a_download_replaces_nothing_unasked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept, new = tmp_path / "kept.src", tmp_path / "new.src"
    kept.write_text("mine")
    run("download", "gs-c200s", "PORT", "--output", kept, status=2)
    run("download", "gs-c200s", "PORT", kept, status=2)
    run("download", "gs-c200s", "PORT", kept, "--output", new, status=2)
    assert kept.read_text() == "mine"
    assert "is there: write to another file, or over it with --overwrite" in capsys.readouterr().err
    with served("gs-c200s") as service:
        run("download", "gs-c200s", address(service), "--output", new)
        run("download", "gs-c200s", address(service), "--output", kept, "--overwrite")
    assert kept.read_text() == new.read_text() != "mine"


def test_a_module_that_is_left_in_programming_mode_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A GS-C200 leaves it by E alone, which starts the program (command description, E)."""
    file = tmp_path / "blink.src"
    file.write_text("A1\nD1\nC1\n")
    with served("gs-c200") as service:
        run("upload", "gs-c200", address(service), file, "--save")
        told = capsys.readouterr().out.splitlines()
        assert told[0] == "Stored 3 instructions, 6 bytes, read them back, and saved it"
        assert told[1].startswith("What the gs-c200 is sent now is stored, too: it is in programming mode")
        run("upload", "gs-c200", address(service), file, "--json")
        assert "E (execute() in Python)" in json.loads(capsys.readouterr().out)["left_open"]
        file.write_text("; nothing\n")
        run("send", "gs-c200", address(service), "E", "Z")
        capsys.readouterr()
        run("upload", "gs-c200", address(service), file)
        assert "programming" not in capsys.readouterr().out, "there is nothing to be started"


def test_a_program_that_is_saved_survives_in_the_eeprom(source: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with served("gs-c200s") as service:
        run("upload", "gs-c200s", address(service), source, "--save", "--json")
        assert json.loads(capsys.readouterr().out)["saved"] is True
        with connect("gs-c200s", address(service)) as unit:
            unit.write_program([])
            unit.recall()
            assert unit.read_program() == ["A1", "D1", "C1", "j0"]


def test_another_program_is_shown_as_a_difference_and_ends_it_with_1(
    source: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with served("gs-c200s") as service:
        run("upload", "gs-c200s", address(service), source)
        source.write_text(SOURCE.replace("D1", "D9").replace("; blinks", "; slowly"))
        capsys.readouterr()
        run("compare", "gs-c200s", address(service), source, status=1)
        out = capsys.readouterr().out
        assert "-   2 D1\n+   2 D9\n" in out
        run("compare", "gs-c200s", address(service), source, "--json", status=1)
        assert "+   2 D9" in json.loads(capsys.readouterr().out)["differences"]


def test_programs_of_a_dcb_274_keep_their_places(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "axis.src"
    file.write_text("P 300\nstart: +100\n  W 0\n  J start 3\nP 128\n  Z\n")
    with served("dcb-274") as service:
        run("upload", "dcb-274", address(service), file, "--save", "--patience", 1)
        assert capsys.readouterr().out == "Stored 4 instructions, 13 bytes, read them back, and saved it\n"
        run("compare", "dcb-274", address(service), file, "--patience", 1)
        run("download", "dcb-274", address(service), tmp_path / "all.src", "--patience", 1)
        text = (tmp_path / "all.src").read_text()
        assert "P 300\nat_300:\n+ 100\nW 0\nJ at_300 3\n" in text
        assert "P 128\nZ 0\n" in text
        file.write_text("P 300\n+100\nW 1\n")
        capsys.readouterr()
        run("compare", "dcb-274", address(service), file, "--patience", 1, status=1)
    assert capsys.readouterr().out.splitlines()[-3:] == ["- 304 W 0", "- 307 J 300 3", "+ 304 W 1"]


def test_nothing_is_sent_unless_all_of_it_can_be(
    source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source.write_text("A1\nA9\nfoo\n")
    run("upload", "gs-c200s", "/dev/no-such-device", source, status=2)
    err = capsys.readouterr().err
    assert f"{source}:2:" in err
    assert f"{source}:3:" in err
    run("upload", "gs-c200s", "/dev/no-such-device", tmp_path / "none.src", status=2)
    assert "none.src: No such file" in capsys.readouterr().err
    run("upload", "bs0610", "/dev/no-such-device", source, status=2)
    assert "a bs0610 holds no programs; models that do: gs-c200" in capsys.readouterr().err
    source.write_bytes(b"\xff\x00")
    run("compare", "gs-c200", "/dev/no-such-device", source, status=2)
    assert "it is no text in UTF-8: byte FF on line 1, column 1" in capsys.readouterr().err


def test_what_does_not_fit_is_refused(source: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source.write_text("+100\n" * 40)  # "Program storage capability: 119 bytes"
    run("upload", "gs-c200", "/dev/no-such-device", source, status=2)
    assert "119" in capsys.readouterr().err
