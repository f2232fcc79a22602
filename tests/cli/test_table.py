"""The verb table: the paper's table, other curves, files, refusals."""

import json
from pathlib import Path

import pytest

from detent.cli import main
from detent.ramps.differences import PAPER, parse


def detent(*tokens: object) -> int | str | None:
    with pytest.raises(SystemExit) as caught:
        main([str(token) for token in tokens])
    return caught.value.code


Capture = pytest.CaptureFixture[str]


def test_without_arguments_it_is_the_papers_table_with_its_budget(capsys: Capture) -> None:
    assert detent("table") == 0
    printed = capsys.readouterr().out
    assert "15000 sin^2(4.54426 t + 0.2097): 232 differences, one every 1.29 ms" in printed
    assert "first N 3076 (650 half steps/s), last N 132 (15038 half steps/s), largest difference 163" in printed
    assert "300  A3 96 8A 80" in printed
    assert "together                1002 of the 1024 bytes of an 8748, 22 left" in printed


def test_the_option_line_makes_a_drive_with_that_table(capsys: Capture) -> None:
    assert detent("table", "--option") == 0
    assert parse(capsys.readouterr().out) == PAPER
    assert detent("table", "linear", "--low", 1000, "--high", 8000, "--duration", "0.2", "--option") == 0
    option = capsys.readouterr().out.strip()
    assert detent("run", "supersigma", "--set", f"table={option}", "--send", "move +5000", "--json") == 0
    assert json.loads(capsys.readouterr().out)["units"]["supersigma"]["position"] == 5000


def test_it_writes_bytes_intel_hex_and_a_listing(tmp_path: Path, capsys: Capture) -> None:
    files = [tmp_path / name for name in ("t.bin", "t.hex", "t.txt")]
    assert detent("table", "--bin", files[0], "--hex", files[1], "--text", files[2], "--at", 0x318) == 0
    assert f"Wrote {files[2]}" in capsys.readouterr().out
    assert files[0].read_bytes() == PAPER.differences
    assert from_hex(files[1].read_text()) == {0x318 + i: value for i, value in enumerate(PAPER.differences)}
    rows = [line.split() for line in files[2].read_text().splitlines() if not line.startswith("#")]
    assert len(rows) == 233
    assert rows[0] == ["0", "0.00", "650.00", "3076", "163"]
    assert rows[-1] == ["232", "299.28", "14999.98", "132"]


def from_hex(text: str) -> dict[int, int]:
    """A reader of Intel HEX, for data and end records."""
    found: dict[int, int] = {}
    for line in text.splitlines():
        assert line[0] == ":"
        record = bytes.fromhex(line[1:])
        assert sum(record) % 256 == 0
        count, address, kind = record[0], int.from_bytes(record[1:3], "big"), record[3]
        assert len(record) == count + 5
        if kind == 0:
            found |= {address + i: value for i, value in enumerate(record[4:-1])}
        else:
            assert (kind, count) == (1, 0)
    return found


def test_json_tells_everything(capsys: Capture) -> None:
    assert detent("table", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["first_n"], told["last_n"], told["largest"], sum(told["differences"])) == (3076, 132, 163, 2944)
    assert (told["bytes_used"], told["bytes_of_eprom"], told["interval_ns"]) == (1002, 1024, 1_290_000)
    assert parse(told["option"]) == PAPER


def test_points_come_from_a_file(tmp_path: Path, capsys: Capture) -> None:
    file = tmp_path / "curve.csv"
    file.write_text("t,V\n# slow at first\n0,650\n0.1,3000\n\n0.3,15000\n")
    assert detent("table", file) == 0
    assert "232 differences" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("tokens", "message"),
    [
        (("linear",), "difference 1, between t = 0.00000 s (650 half steps/s, N = 3076) and"),
        (("--interval", "0.5 ms"), "600 differences, and beside the program the 8748 has room for 254 bytes"),
        (("--interval", "0.7 us"), "--interval: 0.7 us is no whole number of clocks of 500 ns"),
        (("--interval", "soon"), "is no duration"),
        (("--low", "5"), "--low is not for the curve sine: it takes peak, angular, phase"),
        (("linear", "--duration", "0"), "--duration: a ramp takes some time"),
        (("liner",), "no curve 'liner'; did you mean linear?"),
        (("nothing.csv",), "nothing.csv: cannot read it: No such file"),
        (("--at", "1024"), "--at 1024: 232 bytes do not fit there in the 1024 of an 8748; say 0 to 792"),
        (("--peak", "nan"), "the speed is nan"),
    ],
)
def test_what_cannot_be_a_table_is_refused_in_one_line(tokens: tuple[str, ...], message: str, capsys: Capture) -> None:
    assert detent("table", *tokens) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert message in told.err
    assert told.err.count("\n") == 1


def test_a_bad_line_of_a_file_is_named(tmp_path: Path, capsys: Capture) -> None:
    file = tmp_path / "curve.csv"
    for text, message in (
        ("t,V\n0,650\n0.1\n", ":3: '0.1': write t,V in seconds and half steps/s"),
        ("t,V\n", "there are no points t,V in it"),
        ("0,650\n", "a curve needs two points"),
        ("0,650\n0,700\n", "the points must rise in t"),
        ("0,650\n0.2,600\n", "the curve may not fall"),
        ("0,650\nnan,700\n", "the points must rise in t"),
    ):
        file.write_text(text)
        assert detent("table", file) == 2
        told = capsys.readouterr().err
        assert message in told
        assert str(file) in told


def test_a_folder_that_is_not_there_is_named(tmp_path: Path, capsys: Capture) -> None:
    assert detent("table", "--bin", tmp_path / "no" / "t.bin") == 2
    assert "cannot write it" in capsys.readouterr().err
