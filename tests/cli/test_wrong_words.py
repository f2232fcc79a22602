"""Words that no verb was meant for, made by number over all verbs and options: never a traceback, always one style."""

import os
import re
import signal
import tempfile
import traceback
from multiprocessing import get_context
from pathlib import Path
from random import Random
from typing import NamedTuple, NoReturn

import pytest

from detent.cli import VERBS, application, main

NO_PORT = "/dev/no-such-port"

# What each verb is given besides: it would end at once, or for want of a port, or go on until it is stopped.
BASE = {
    "demo": "menu", "examples": "list", "models": "gs-c200", "workbench": "gs-c200", "serve": "gs-c200",
    "control": "127.0.0.1:1", "boards": "check cell.toml", "service": "cell.toml", "run": "gs-c200",
    "asm": "gs-c200 p.gsc", "list": "gs-c200 p.gsc", "disasm": "gs-c200 p.img", "find": NO_PORT,
    "send": f"gs-c200 {NO_PORT} F", "terminal": f"gs-c200 {NO_PORT}", "bench": f"gs-c200 {NO_PORT}",
    "backup": f"gs-c200 {NO_PORT} b.toml", "restore": f"gs-c200 {NO_PORT} cell.toml",
    "upload": f"gs-c200 {NO_PORT} p.gsc", "download": f"gs-c200 {NO_PORT}", "compare": f"gs-c200 {NO_PORT} p.gsc",
    "motor": "qsh4218-41-10-035", "tune": "gs-c200 --motor qsh4218-41-10-035 --moves 100",
    "compare-moves": "gs-c200 S=1 S=2 --motor qsh4218-41-10-035 --moves 10", "table": "sine", "size": "bs0610",
    "wiring": "1-2=5", "docs": "gsc200", "epics": "gs-c200",
}  # fmt: skip

WORDS = [
    "", "nan", "inf", "-inf", "-1", "0", "1e999", "99999999999999999999999", "x" * 400, "x" * 5000,
    "9" * 5000, "1," * 3000, "\u00e9", "\u2603", "\x01",
    "\x1b[2J", "folder", "/dev/null", "/dev/zero", "missing", "missing/x", "binary.toml", "=", "a=b=c", "=5", "a=", ":",
    ":::", "127.0.0.1:99999", "host:port", "[::1]:x", "rfc2217://", "--", "-", "1/0", "0x10", "1_000", "\u0663", "\n",
    "a\nb", "\udcff", "../../x", "cell.toml", "p.gsc", "p.img", "gs-c200", "dcb-274", "0-0=0", "1-2=-5", "S=", "S=nan",
    "I=1e99", "inertia=nan", "1x0", "1x-5", "5,", "@", "@ idle", "'", "$(x)", "%s", "{}", "UNIT.PIN", "unit.x=high",
    "CHS=maybe",
]  # fmt: skip
STOPPED = -signal.SIGALRM  # it was running well: nothing was wrong


class Ended(NamedTuple):
    """How a command line ended, and what it said."""

    code: int
    said: str
    errors: str


def options(verb: str) -> list[tuple[str, bool]]:
    """The options of a verb, and whether each is followed by a word."""
    app = application(verb)[verb]
    return [
        (name, argument.hint is not bool)
        for argument in app.assemble_argument_collection()
        for name in argument.names
        if name.startswith("--")
    ]


def line(draw: Random, verb: str, known: list[tuple[str, bool]]) -> list[str]:
    """A command line with something wrong in it, most likely."""
    words = BASE[verb].split()
    kind = draw.random()
    if kind < 0.75:
        for _ in range(draw.choice((1, 1, 1, 2))):
            option, takes = draw.choice(known)
            words += [option, draw.choice(WORDS)] if takes or draw.random() < 0.1 else [option]
    elif kind < 0.9:
        words[draw.randrange(len(words))] = draw.choice(WORDS)
    else:
        words = [*words[: draw.randrange(len(words) + 1)], draw.choice(WORDS)]
    return [verb, *words]


# Not of this process: other tests have made threads here, and what they compute with cannot be forked.
CLEAN = get_context("forkserver")
CLEAN.set_forkserver_preload(["tests.cli.test_wrong_words"])


def ended(words: list[str], folder: Path, seconds: int) -> Ended:
    """Run a command line in a process of its own, in `folder`."""
    with tempfile.NamedTemporaryFile() as out, tempfile.NamedTemporaryFile() as err:
        child = CLEAN.Process(target=_be, args=(words, folder, seconds, out.name, err.name))
        child.start()
        child.join()
        assert child.exitcode is not None
        said, errors = (data.read().decode("utf-8", "replace") for data in (out, err))
        return Ended(child.exitcode, said, errors)


def _be(words: list[str], folder: Path, seconds: int, out: str, err: str) -> NoReturn:
    code = 99
    try:
        os.chdir(folder)
        os.environ |= {"HOME": str(folder), "XDG_STATE_HOME": str(folder / "state"), "BROWSER": "true"}
        for here, name in enumerate((os.devnull, out, err)):
            os.dup2(os.open(name, os.O_RDWR), here)
        import sys

        sys.stdin, sys.stdout, sys.stderr = open(0), open(1, "w"), open(2, "w", errors="backslashreplace")  # noqa: SIM115
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(seconds)
        main(words)
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 98 if error.code else 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def judged(words: list[str], how: Ended) -> str:
    """What is wrong with the end of a command line, or nothing."""
    place = r"\S+:\d+:\d+: "  # an error of a source, as compilers and editors write it
    if "Traceback" in how.said + how.errors or how.code not in (0, 1, 2, STOPPED):
        return f"ends with {how.code}"
    if how.code in (1, 2) and not how.said and not how.errors:
        return "ends without a word"
    if how.code in (1, 2) and how.errors and not re.match(rf"detent: |{place}", how.errors):
        return "has a style of its own"
    if how.code in (1, 2) and (how.errors.count("\n") > 8 or max(map(len, how.errors.splitlines()), default=0) > 1500):
        return "says too much"
    if how.code in (1, 2) and re.search(r"[\x00-\x08\x0b-\x1f\x7f]", how.errors):
        return "steers the terminal"
    return ""


@pytest.mark.parametrize(
    "line",
    ["run gs-c200 --send @", "run @", "wiring @", "motor qsh4218-41-10-035 --move 100 --seed @", "size bs0610 x=@",
     "motor qsh4218-41-10-035 --as supersigma table=@ --move 100", "run gs-c200 --sr a.sr --sr-rate @",
     "run gs-c200 --for @", "run supersigma --set table=@", "@", "table @", "models @"],
)  # fmt: skip
def test_an_error_quotes_no_more_than_a_line_holds(line: str, tmp_path: Path) -> None:
    for word in ("9" * 5000, "x" * 5000, "1," * 3000):
        words = [one.replace("@", word) for one in line.split()]
        how = ended(words, tmp_path, 60)
        assert how.code in (1, 2)
        assert not judged(words, how), how.errors[:200]


@pytest.mark.parametrize(
    "line",
    ["table sine --duration 1000000h", "table sine --interval 500ns --duration 1h", "table linear --duration 8766h"],
)
def test_a_table_of_a_curve_that_takes_very_long_is_refused_at_once(line: str, tmp_path: Path) -> None:
    how = ended(line.split(), tmp_path, 20)
    assert how.code == 2
    assert "make it shorter or the interval longer" in how.errors


@pytest.mark.parametrize(
    ("words", "told"),
    [("--port 99999", "--port 99999: a port is"), ("--port -1", "--port -1: a port is"), ("--pace 1e300", "--pace"),
     ("--pace -1", "--pace"), ("--pace nan", "--pace"), (f"--memory {10**21}", "--memory"), ("--memory 5", "--memory")],
)  # fmt: skip
def test_a_number_that_no_workbench_takes_is_told_with_its_option(words: str, told: str, tmp_path: Path) -> None:
    how = ended(["workbench", "gs-c200", *words.split()], tmp_path, 60)
    assert how.code == 2
    assert how.errors.startswith(f"detent: {told}")
    assert not judged([], how)


NUMBERS = ("-1", "0", "99999", "65536", "99999999999999999999999", "1e300", "1e-300", "nan")


@pytest.mark.slow
@pytest.mark.parametrize("verb", VERBS)
def test_any_number_of_any_option_is_taken_or_refused(verb: str, tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text('[units.u]\nmodel = "gs-c200"\n')
    (tmp_path / "p.gsc").write_text("+100\n")
    (tmp_path / "p.img").write_bytes(b"\x2b\x00\x00\x64")
    for argument in application(verb)[verb].assemble_argument_collection():
        names = [name for name in argument.names if name.startswith("--")]
        if names and re.search(r"\b(int|float)\b", str(argument.hint)):
            for number in NUMBERS:
                words = [verb, *BASE[verb].split(), names[0], number]
                how = ended(words, tmp_path, 10)
                assert not judged(words, how), (words, how)


@pytest.mark.slow
@pytest.mark.parametrize("verb", VERBS)
def test_no_wrong_word_ends_in_a_traceback(verb: str, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "binary.toml").write_bytes(bytes(range(256)))
    (tmp_path / "cell.toml").write_text('[units.u]\nmodel = "gs-c200"\n')
    (tmp_path / "p.gsc").write_text("+100\n")
    (tmp_path / "p.img").write_bytes(b"\x2b\x00\x00\x64")
    known = options(verb)
    for number in range(8):
        words = line(Random(f"{verb} {number}"), verb, known)
        how = ended(words, tmp_path, 20)
        assert not judged(words, how), (words, how)
