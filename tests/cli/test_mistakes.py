"""What is asked wrongly, of every verb: one or a few lines on stderr that say what to do, and never a traceback."""

import io
import re
from pathlib import Path

import pytest

from detent.cli import VERBS, main

NO_PORT = "/dev/no-such-port"

MISTAKES = """
modles | did you mean
demo driling | did you mean drilling
demo --output | --output
demo drilling extra more words |
examples copy | detent examples copy NAME
examples copy menue | did you mean menu
examples copy menu {file} | is there
examples show | list
examples list menu | did you mean
models gs-c20 | did you mean gs-c200
models gs-c200 extra |
models --jsn | --json
workbench gs-c20 | did you mean gs-c200
workbench gs-c200 --port x | --port
workbench gs-c200 --at : | cannot be opened
workbench gs-c200 --at /dev/no-such-port --address 9 | 1 to 7
workbench {missing}.toml | cannot read it
serve gs-c20 | did you mean gs-c200
serve {missing}.toml | cannot read it
serve {text}.toml |
serve gs-c200 --strap CHS | NAME=VALUE
serve gs-c200 --strap CHX=low | did you mean CHS
serve gs-c200 --set clok=split |
serve gs-c200 --tcp nowhere |
serve gs-c200 --pace -1 |
serve gs-c200 --pace fast | fast
control nowhere |
control http://127.0.0.1:1 |
control |
run gs-c20 | did you mean gs-c200
run | detent run --help
run {missing}.toml | cannot read it
run {binary}.toml |
run gs-c200 --for never |
run gs-c200 --for -1 |
run gs-c200 --send |
run gs-c200 --vcd {missing}/x.vcd --send +1 | cannot write it
run gs-c200 --plot x.doc |
run gs-c200 --sr-rate 5 | --sr
run gs-c200 --program {missing}.gsc |
run gs-c200 --program {binary}.toml |
asm gs-c20 {text}.toml | did you mean gs-c200
asm gs-c200 {missing}.src | No such file
asm gs-c200 {text}.toml | takes a direction
asm gs-c200 {binary}.toml |
asm gs-c200 {folder} |
list gs-c200 {missing}.src | No such file
disasm gs-c200 {missing}.bin | No such file
disasm gs-c200 {folder} |
find /dev/no-such-port --model gs-c20 | did you mean gs-c200
find --baud 1234 /dev/no-such-port | none of these controllers talks at 1234
find --model gs-c200 --model supersigma {port} |
find host:port:what |
send | detent send --help
send gs-c200 |
send gs-c20 {port} F | did you mean gs-c200
send gs-c200 {port} | say what to send
send gs-c200 {port} F | cannot be opened
send gs-c200 127.0.0.1:1 F | cannot be opened
send gs-c200 {port} F --address 9 | 1 to 7
send gs-c200 {port} F --motor X | --motor is not for a gs-c200
send gs-c200 {port} F --parity often | none, odd, even
send gs-c200 {port} F --baud -5 | bits a second
send gs-c200 {port} F --baud many | many
send gs-c200 {port} F --patience 0 | some time
send gs-c200 {port} F --patience nan |
send gs-c200 {port} F --wait inf |
send dcb-274 {port} X --mode ring | single, party
send dcb-274 {port} X --mode party | name
terminal gs-c20 | did you mean gs-c200
terminal gs-c200 --address 3 | without PORT
terminal gs-c200 {port} | cannot be opened
bench gs-c20 {port} | did you mean gs-c200
bench gs-c200 {port} |
backup gs-c200 {port} | FILE
backup supersigma {port} {missing}.toml | keeps nothing
backup gs-c200 {port} {missing}.toml | cannot be opened
restore gs-c200 {port} {missing}.toml | cannot read it
restore gs-c200 {port} {text}.toml | it is no
restore gs-c200 {port} {binary}.toml | text file
restore gs-c200 {port} {folder} --yes | cannot read it
upload gs-c200 {port} {missing}.src | No such file
upload gs-c200 {port} {text}.toml | takes a direction
upload supersigma {port} {text}.toml |
download gs-c200 {port} {text}.toml | over it with --overwrite
download gs-c20 {port} | did you mean gs-c200
download gs-c200 {port} --output {long} | too long
find \x01 | \\x01
compare gs-c200 {port} {missing}.src | No such file
compare-moves gs-c20 S=1 S=2 --motor qsh4218-41-10-035 --moves 100 --supply 24 | did you mean gs-c200
compare-moves gs-c200 S=1 Q=2 --motor qsh4218-41-10-035 --moves 100 --supply 24 | no setting 'Q'
motor qsh4218-41-10-03 | did you mean
motor qsh4218-41-10-035 --move ten | ten
motor {missing}.toml |
table {missing}.txt |
size bs061 | did you mean bs0610
size bs0610 voltage | NAME=VALUE
size bs0610 volt=3 | did you mean voltage
size gs-c200-slew force=-1 length=1 time=1 torque=1 | above 0
size gs-c200-current ramp=3 | 2 A a phase at most
wiring 1-2 | LEAD-LEAD=OHMS
wiring 1-2=hello | LEAD-LEAD=OHMS
wiring 1-2=5 | number 4, 5 or 6 leads
wiring --motor 123 |
docs nowhere at all |
epics gs-c20 |
epics {missing}.toml |
epics gs-c200 --prefix a.b | letters, digits
epics gs-c200 --ca-port 70000 | 1 to 65535
epics gs-c200 --list-pvs --max-velocity 0x | max-velocity
boards chek |
service {missing}.toml |
"""


def cases() -> list[tuple[str, str]]:
    rows = [line.partition("|") for line in MISTAKES.strip().splitlines()]
    return [(words.strip(), remedy.strip()) for words, _, remedy in rows]


@pytest.fixture(autouse=True)
def nobody_types(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO())


@pytest.mark.parametrize(("words", "remedy"), cases(), ids=[words for words, _ in cases()])
def test_a_mistake_is_told_with_what_to_do(
    words: str, remedy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("mine\n")
    (tmp_path / "text.toml").write_text("hello, world\n")
    (tmp_path / "binary.toml").write_bytes(bytes(range(256)))
    (tmp_path / "folder").mkdir()
    names = {name: str(tmp_path / name) for name in ("file", "text", "binary", "folder", "missing")}
    names["long"] = "x" * 400
    with pytest.raises(SystemExit) as ended:
        main(words.format(port=NO_PORT, **names).split())
    out, err = capsys.readouterr()
    assert ended.value.code in (1, 2), out + err
    place = r"\S+:\d+:\d+: "  # an error of a source, as compilers and editors write it
    assert err.startswith("detent: ") or re.match(place, err), err
    assert "Traceback" not in err
    assert err.count("\n") <= 8
    assert remedy.lower() in " ".join(err.lower().split())
    assert (tmp_path / "file").read_text() == "mine\n"
    assert sorted(path.name for path in tmp_path.iterdir() if path.name != "state") == [
        "binary.toml", "file", "folder", "text.toml",
    ]  # fmt: skip


def test_the_table_is_long_and_leaves_no_verb_out() -> None:
    assert len(cases()) >= 60
    assert {words.split()[0] for words, _ in cases()} >= set(VERBS) - {"tune", "docs"}


READERS = """
run | serve | service | epics | boards check | workbench | motor | table | asm gs-c200 | list dcb-274 | disasm dcb-274
restore gs-c200 {port} | upload gs-c200 {port} | compare gs-c200 {port} | run gs-c200 --program
tune gs-c200 --motor qsh4218-41-10-035 --moves 100 --batch | tune gs-c200 --moves 100 --motor
compare-moves gs-c200 S=1 S=2 --moves 10 --motor | motor qsh4218-41-10-035 --curve
"""


@pytest.mark.parametrize("verb", [" ".join(words.split()) for words in re.split(r"[|\n]", READERS.strip())])
def test_no_file_is_too_strange_to_be_told(
    verb: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)
    files = {
        "binary": bytes(range(256)), "deep": b"a = " + b"[" * 5000 + b"]" * 5000, "digits": b"a = " + b"9" * 5000,
        "nan": b"a = nan\nb = -inf\n", "words": b"hello, world\n", "marked": b"\xef\xbb\xbfhello\r\n\x1a",
    }  # fmt: skip
    for name, data in files.items():
        Path(f"{name}.toml").write_bytes(data)
    Path("folder.toml").mkdir()
    for name in (*(f"{name}.toml" for name in files), "folder.toml", "/dev/zero"):
        with pytest.raises(SystemExit) as ended:
            main([*verb.format(port=NO_PORT).split(), name])
        out, err = capsys.readouterr()
        assert ended.value.code in (1, 2), (name, out, err)
        assert err.startswith("detent: ") or re.match(r"\S+:\d+:\d+: ", err), (name, err)
        assert "recursion" not in err, name
