"""No verb writes over a file unasked: one rule, held against every verb that writes one."""

from importlib import import_module
from pathlib import Path

import pytest

from detent.cli import VERBS, application, main

MINE = "mine\n"

# The verb and what it writes, a line that writes it to {out}, and how it is asked to write over what is there.
OUTPUTS = {
    ("demo", "output"): ("demo menu --output {folder}", "--overwrite"),
    ("run", "plot"): ("run gs-c200 --plot {out}.png", "--overwrite"),
    ("run", "vcd"): ("run gs-c200 --vcd {out}.vcd", "--overwrite"),
    ("run", "sr"): ("run gs-c200 --for 1ms --sr {out}.sr", "--overwrite"),
    ("run", "npz"): ("run gs-c200 --npz {out}.npz", "--overwrite"),
    ("run", "steps"): ("run gs-c200 --steps {out}.csv", "--overwrite"),
    ("service", "output"): ("service {cell} --output {out}", "--overwrite"),
    ("asm", "output"): ("asm gs-c200 {source} --output {out}", "--overwrite"),
    ("disasm", "output"): ("disasm gs-c200 {image} --output {out}", "--overwrite"),
    ("download", "output"): ("download gs-c200 /dev/no-such-port --output {out}", ""),
    ("download", "file"): ("download gs-c200 /dev/no-such-port {out}", ""),
    ("motor", "plot"): ("motor qsh4218-41-10-035 --supply 24 --plot {out}.png", "--overwrite"),
    ("compare-moves", "plot"): (
        "compare-moves gs-c200 S=1 S=2 --motor qsh4218-41-10-035 --moves 10 --supply 24 --plot {out}.png", ""),
    ("tune", "map_"): ("tune gs-c200 --motor qsh4218-41-10-035 --supply 24 --moves 200 --map {out}.csv", ""),
    ("tune", "into"): ("tune gs-c200 --motor qsh4218-41-10-035 --supply 24 --moves 200 --into {out}", ""),
    ("table", "bin_"): ("table --bin {out}", "--overwrite"),
    ("table", "hex_"): ("table --hex {out}", "--overwrite"),
    ("table", "text"): ("table --text {out}", "--overwrite"),
    ("examples", "folder"): ("examples copy menu {out}", ""),
    ("--install-completion", "output"): ("--install-completion --shell bash --output {out}", "--overwrite"),
}  # fmt: skip

# Files that are read, or, for a backup, get a number where one is there (test_backup).
READ = {
    ("asm", "file"), ("list", "file"), ("disasm", "file"), ("backup", "file"), ("restore", "file"), ("upload", "file"),
    ("compare", "file"), ("tune", "from_"), ("tune", "batch"), ("workbench", "folder"),
}  # fmt: skip
SERVED = {("serve", name) for name in ("pty", "serial", "state")} | {
    ("workbench", x) for x in ("pty", "serial", "state")
}


@pytest.fixture
def names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Path]:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    (tmp_path / "cell.toml").write_text('[units.u]\nmodel = "gs-c200"\n')
    (tmp_path / "source").write_text("+100\n")
    (tmp_path / "image").write_bytes(bytes.fromhex("ffff"))
    (tmp_path / "folder").mkdir()
    names = {"out": tmp_path / "out", "cell": tmp_path / "cell.toml", "folder": tmp_path / "folder"}
    main_quietly("asm", "gs-c200", str(tmp_path / "source"), "--output", str(tmp_path / "image.bin"))
    return {**names, "source": tmp_path / "source", "image": tmp_path / "image.bin"}


def main_quietly(*words: str) -> int:
    with pytest.raises(SystemExit) as ended:
        main(words)
    return int(ended.value.code or 0)


def places(line: str, names: dict[str, Path]) -> list[Path]:
    """The files that a line writes."""
    if "{folder}" in line:
        return [names["folder"] / "menu.png", names["folder"] / "menu.vcd"]
    suffix = next((word[5:] for word in line.split() if word.startswith("{out}")), "")
    return [names["out"].with_name("out" + suffix)]


@pytest.mark.parametrize("what", OUTPUTS, ids=lambda what: "-".join(what))
def test_a_file_that_is_there_stays_unless_it_is_asked_for(
    what: tuple[str, str], names: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    line, asked = OUTPUTS[what]
    files = places(line, names)
    for file in files:
        file.write_text(MINE)
    words = line.format(**names).split()
    assert main_quietly(*words) == 2
    err = capsys.readouterr().err
    assert f"{files[0]} is there: " in err
    assert err.count("\n") == 1
    assert [file.read_text() for file in files] == [MINE] * len(files)
    if asked:
        assert f"over it with {asked}" in err
        for spelled in (asked, "--force") if what[0] != "motor" else (asked,):
            for file in files:
                file.write_text(MINE)
            assert main_quietly(*words, spelled) == 0, capsys.readouterr().err
            assert all(MINE.encode() != file.read_bytes() for file in files)


def test_what_a_run_has_made_makes_room_for_a_newer_one(names: dict[str, Path]) -> None:
    for _ in range(2):
        assert main_quietly("run", "gs-c200", "--vcd", f"{names['out']}.vcd", "--plot", f"{names['out']}.png") == 0


@pytest.mark.parametrize("words", [
    "table {source} --hex {source} --overwrite",
    "asm gs-c200 {source} --output {source} --overwrite",
    "disasm gs-c200 {image} --output {image} --overwrite",
    "run {cell} --vcd {cell} --overwrite",
    "service {cell} --output {cell} --overwrite",
    "table --bin {out} --hex {out} --overwrite",
    "run gs-c200 --vcd {out} --npz {out}",
])  # fmt: skip
def test_what_is_read_is_never_written_over_and_two_outputs_have_two_files(
    words: str, names: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    before = {name: file.read_bytes() for name, file in names.items() if file.is_file()}
    assert main_quietly(*words.format(**names).split()) == 2
    err = capsys.readouterr().err
    assert "is read here, and would be lost" in err or "two outputs cannot go to one file" in err
    assert {name: file.read_bytes() for name, file in names.items() if file.is_file()} == before


MOTOR = "motor as1010 --move 200 --supply 24 --overwrite --plot {read}.png"
TUNE = "tune gs-c200 --motor as1010 --supply 24 --moves 200 --overwrite --map {read}.csv"
COMPARE = "compare-moves gs-c200 S=1 S=2 --motor as1010 --moves 10 --supply 24 --overwrite --plot {read}.png"
OWN = "motor {own} --move 200 --supply 24 --overwrite --plot {read}.png"


@pytest.mark.parametrize(
    "line",
    [
        *(
            f"{verb} {one} {{read}}"
            for verb in (MOTOR, TUNE, COMPARE)
            for one in ("--curve", "--load-by", "--ring-down")
        ),
        OWN,
        "service {cell} --overwrite --output {read}",
        "run {cell} --overwrite --vcd {read}",
        "run gs-c200 --program {read} --overwrite --vcd {read}",
        "table --curve {read} --low 800 --high 9000 --overwrite --hex {read}",
    ],
)
def test_whatever_a_verb_reads_it_does_not_write_over_even_if_it_is_asked_to(
    line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    suffix = next((ending for ending in (".png", ".csv") if f"{{read}}{ending}" in line), "")
    read = tmp_path / f"read{suffix}"
    read.write_text("half steps/s, Nm\n100, 0.2\n1000, 0.1\n" if "{cell}" not in line else "+100\n")
    (tmp_path / "cell.toml").write_text(f'[units.u]\nmodel = "gs-c200"\nprogram = "{read.name}"\n')
    (tmp_path / "own.toml").write_text(
        "resistance = 1.1\ninductance = 3.6e-3\ncurrent = 2.8\ntorque = 1.26\ninertia = 3e-5\n"
        f"[curve]\nfile = '{read.name}'\nsupply = 48\n"
    )
    before = read.read_bytes()
    names = {"read": read, "cell": tmp_path / "cell.toml", "own": tmp_path / "own.toml"}
    assert main_quietly(*(word.format(**names) for word in line.replace("{read}" + suffix, "{read}").split())) == 2
    assert "is read here, and would be lost" in capsys.readouterr().err
    assert read.read_bytes() == before


@pytest.mark.parametrize("verb", sorted({verb for verb, _ in OUTPUTS if verb in VERBS} - {"examples"}))
def test_every_verb_that_writes_is_asked_by_the_same_word(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    """And takes --force for it as well, but where a load has a force in N: there it says so."""
    arguments = application(verb)[verb].assemble_argument_collection()
    asks = next(argument for argument in arguments if "--overwrite" in argument.names)
    if {"--force"} in [set(argument.names) for argument in arguments]:
        line = next(line for (name, _), (line, _) in OUTPUTS.items() if name == verb)
        assert main_quietly(*line.split(), "--force") == 2
        assert "--overwrite" in capsys.readouterr().err
    else:
        assert "--force" in asks.names


def test_every_file_that_a_verb_is_given_is_in_the_table() -> None:
    places = {**{verb: place for verb, (place, _) in VERBS.items()},
              "--install-completion": "detent.cli.completing:install"}  # fmt: skip
    given = set()
    for verb, place in places.items():
        module, name = place.split(":")
        found = getattr(import_module(module), name)
        given |= {(verb, parameter) for parameter, kind in found.__annotations__.items() if "Path" in str(kind)}
    assert given == set(OUTPUTS) | READ | SERVED
