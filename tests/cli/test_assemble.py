"""The verbs asm, list and disasm: what they print, what they write, how they end."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from detent.cli import main
from detent.cli.assemble import asm, disasm, list_

SOURCE = "; two\nstart: s10 ; slow\n\tj start\n"
IMAGE = bytes.fromhex("530a0000 6a00")


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "two.prg"
    path.write_text(SOURCE)
    return path


def status(run: Callable[[], None]) -> int | str | None:
    with pytest.raises(SystemExit) as caught:
        run()
    return caught.value.code


def test_asm_prints_the_commands_as_they_go_on_the_wire_and_the_memory_they_take(
    source: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    asm("gs-c200s", source)
    printed = capsys.readouterr().out
    assert printed == "S10\nj0\n; 6 of 119 bytes\n"
    again = tmp_path / "again.prg"  # what it prints is itself a program file
    again.write_text(printed)
    asm("gs-c200s", again)
    assert capsys.readouterr().out == printed


def test_asm_writes_an_image_hex_or_commands(source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "out"
    asm("gs-c200s", source, output=output)
    assert output.read_bytes() == IMAGE
    asm("gs-c200s", source, output=output, format="hex", overwrite=True)
    assert output.read_text() == "53 0A 00 00 6A 00\n"
    asm("gs-c200s", source, output=output, format="commands", overwrite=True)
    assert output.read_text() == "S10\nj0\n"
    capsys.readouterr()
    asm("gs-c200s", source, format="hex")
    assert capsys.readouterr().out == "53 0A 00 00 6A 00\n; 6 of 119 bytes\n"


def test_asm_and_list_tell_the_same_facts_as_json(source: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asm("gs-c200s", source, json=True)
    facts = json.loads(capsys.readouterr().out)
    assert facts.pop("output") is None
    assert facts["bytes_used"] == 6
    assert facts["capacity"] == 119
    assert facts["labels"] == {"start": 0}
    assert bytes.fromhex(facts["image"]) == IMAGE
    assert facts["instructions"][1] == {
        "address": 4, "bytes": "6a00", "command": "j0", "line": 3, "source": "\tj start",
    }  # fmt: skip
    list_("gs-c200s", source, json=True)
    assert json.loads(capsys.readouterr().out) == facts


def test_list_prints_addresses_bytes_and_source(source: Path, capsys: pytest.CaptureFixture[str]) -> None:
    list_("gs-c200s", source)
    lines = capsys.readouterr().out.splitlines()
    assert lines[2] == "      0      4  53 0A 00 00   start: s10 ; slow"
    assert lines[-1] == "6 bytes used of 119"


def test_disasm_gives_source_that_assembles_to_the_image(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    image, output = tmp_path / "image", tmp_path / "out.prg"
    image.write_bytes(IMAGE)
    disasm("gs-c200s", image)
    assert capsys.readouterr().out == "at_0:\nS10\nj at_0\n"
    disasm("gs-c200s", image, output=output, json=True)
    assert json.loads(capsys.readouterr().out) == {
        "model": "gs-c200s", "file": str(image), "bytes_used": 6, "source": output.read_text(),
        "output": str(output),
    }  # fmt: skip
    asm("gs-c200s", output, output=tmp_path / "again")
    assert (tmp_path / "again").read_bytes() == IMAGE


@pytest.mark.parametrize("verb", [asm, list_])
def test_every_error_of_a_source_is_shown_with_its_place_and_the_status_is_2(
    verb: Callable[..., None], source: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source.write_text("A9\nW1\n  E\n")
    assert status(lambda: verb("gs-c200", source)) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.splitlines() == [
        f"{source}:1:2: A takes an output, 1 to 3, not '9'",
        "    A9",
        "     ^",
        f"{source}:3:3: E acts at once and is not stored in a program; leave it out: "
        "running a program loads and executes it",
        "      E",
        "      ^",
    ]
    assert status(lambda: verb("gs-c200", source, json=True)) == 2
    errors = json.loads(capsys.readouterr().out)["errors"]
    assert [(error["line"], error["column"]) for error in errors] == [(1, 2), (3, 3)]
    assert errors[0]["file"] == str(source)


def test_a_source_in_error_leaves_the_output_file_alone(source: Path, tmp_path: Path) -> None:
    output = tmp_path / "image"
    output.write_bytes(b"old")
    source.write_text("A9")
    assert status(lambda: asm("gs-c200", source, output=output)) == 2
    assert output.read_bytes() == b"old"


@pytest.mark.parametrize("verb", [asm, list_, disasm])
def test_an_unknown_model_is_told_with_the_models_there_are(
    verb: Callable[..., None], source: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status(lambda: verb("GS-200", source)) == 2
    message = capsys.readouterr().err
    assert "'GS-200'" in message
    assert "did you mean gs-c200?" in message
    assert "gs-c200s" in message


@pytest.mark.parametrize("verb", [asm, list_, disasm])
def test_a_file_that_cannot_be_read_is_status_2(
    verb: Callable[..., None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status(lambda: verb("gs-c200", tmp_path / "none")) == 2
    assert capsys.readouterr().err == f"detent: {tmp_path / 'none'}: No such file or directory\n"


def test_files_of_the_wrong_kind_are_told_apart(source: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert status(lambda: disasm("gs-c200", source)) == 2
    assert "byte 0 holds 3Bh, which is no op-code; is it an image" in capsys.readouterr().err
    source.write_bytes(b"G\xff\xff\x80")
    assert status(lambda: asm("gs-c200", source)) == 2
    assert "save it as UTF-8, or use disasm if it is an image" in capsys.readouterr().err


def test_an_image_needs_a_file_and_a_folder_that_is_there(
    source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status(lambda: asm("gs-c200s", source, format="image")) == 2
    assert "--output" in capsys.readouterr().err
    assert status(lambda: asm("gs-c200s", source, output=tmp_path / "no" / "x")) == 2
    assert "there is no folder" in capsys.readouterr().err


def test_a_source_saved_with_a_byte_order_mark_is_read(source: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source.write_text("\ufeffA1\n")
    asm("gs-c200", source)
    assert capsys.readouterr().out.startswith("A1\n")


def test_an_output_never_replaces_what_it_is_made_from(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, image = tmp_path / "a.gsc", tmp_path / "a.bin"
    source.write_text("S10\n")
    with pytest.raises(SystemExit):
        main(["asm", "gs-c200", str(source), "--output", str(image)])
    for verb, file in (("asm", source), ("disasm", image)):
        link = tmp_path / f"{verb}.link"
        link.symlink_to(file)
        before = file.read_bytes()
        with pytest.raises(SystemExit) as caught:
            main([verb, "gs-c200", str(file), "--output", str(link)])
        assert caught.value.code == 2
        assert "is read here, and would be lost: write to another file" in capsys.readouterr().err
        assert file.read_bytes() == before


@pytest.mark.parametrize("verb", ["asm", "list"])
@pytest.mark.parametrize(
    "source",
    [
        b"\xef\xbb\xbfS10\r\n+100\r\n",
        b"S10\r\n+100\r\n\x1a",
        b"S10\n+100\x1a\x1a\r\n",
        b"S10\r\n+100 ; \xc3\xa9\x1a",
    ],  # fmt: skip,
)
def test_sources_of_other_tools_are_read_as_they_are_meant(
    verb: str, source: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A mark before UTF-8, CR LF, the ^Z behind a file of DOS."""
    file = tmp_path / "old.gsc"
    file.write_bytes(source)
    with pytest.raises(SystemExit) as ended:
        main([verb, "gs-c200s", str(file)])
    out, err = capsys.readouterr()
    assert not ended.value.code, err
    assert "S10" in out
    assert "+100" in out


def test_a_source_in_latin_1_is_told_with_the_byte(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "old.gsc"
    file.write_bytes(b"S10\r\n+100 ; \xe9\r\n")
    with pytest.raises(SystemExit) as ended:
        main(["asm", "gs-c200s", str(file)])
    assert ended.value.code == 2
    assert "byte E9 on line 2, column 8; save it as UTF-8" in capsys.readouterr().err
