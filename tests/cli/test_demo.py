"""The verb demo: example 2 of the GS-C200 datasheet, told, drawn, and named for what to do next."""

import json
from pathlib import Path

import pytest

from detent.cli import main


def detent(*tokens: str) -> int | str | None:
    with pytest.raises(SystemExit) as caught:
        main(tokens)
    return caught.value.code


def test_the_demo_drills_five_holes_and_tells_who_moved_and_who_waited(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "detent-demo"
    assert detent("demo", "--output", str(folder)) == 0
    printed = capsys.readouterr().out
    assert printed.count("pull down the drill") == 5
    assert printed.count("lift the drill up") == 5
    assert printed.count("next drilling position") == 4
    assert "5 holes drilled, the bar cut off at 3.385 s." in printed
    assert "start switch set to 1" in printed
    for file in ("drilling.png", "drilling.vcd"):
        assert str(folder / file) in printed
        assert (folder / file).stat().st_size > 10_000
    assert "serve" in printed.splitlines()[-1]
    assert printed.splitlines()[-1].endswith("drilling/cell.toml")


def test_the_demo_twice_makes_the_same_files_byte_for_byte(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for run in ("one", "two"):
        assert detent("demo", "--output", str(tmp_path / run), "--json") == 0
        found = json.loads(capsys.readouterr().out)
        assert found["units"]["drill"]["pulses"] == 5 * 300
        assert found["timeline"][0]["instruction"] == "W1"
    for file in ("drilling.png", "drilling.vcd"):
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()


def test_an_example_that_is_none_and_a_folder_that_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert detent("demo", "driling") == 2
    assert "no example 'driling'; did you mean drilling?" in capsys.readouterr().err
    (tmp_path / "file").write_text("")
    assert detent("demo", "--output", str(tmp_path / "file")) == 1
    assert "choose another folder with --output" in capsys.readouterr().err
