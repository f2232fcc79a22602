"""What has to work where parts of POSIX are missing: each command in a process that has none of them.

What serves, and what is asked of it, are processes; the other verbs are given to one in turn.

It stands in for a system that nobody here has: the modules cannot be imported, and what else such a system lacks is
taken away before anything is loaded. What it cannot show is told in `docs/explanation/other-systems.md`.
"""

import ast
import contextlib
import json
import os
import subprocess
import sys
import urllib.request
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

MISSING = ("termios", "fcntl", "pty", "tty", "resource", "grp", "pwd")
SITE = f"""
import sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name in {MISSING!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
        return None

sys.meta_path.insert(0, Missing())
for name in {MISSING!r}:
    sys.modules.pop(name, None)

import os, select, signal
for module, names in (
    (select, ("poll", "epoll", "POLLRDHUP")),
    (signal, ("SIGHUP", "pthread_kill")),
    (os, ("openpty", "fchmod", "sched_setscheduler", "O_NOFOLLOW", "O_NOCTTY", "getuid")),
):
    for name in names:
        if hasattr(module, name):
            delattr(module, name)
"""


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, str]:
    """The environment of a process that lacks them."""
    folder = tmp_path_factory.mktemp("elsewhere")
    (folder / "sitecustomize.py").write_text(SITE)
    path = os.pathsep.join(filter(None, (str(folder), os.environ.get("PYTHONPATH"))))
    names = ("LOGNAME", "USER", "LNAME", "USERNAME")  # by which the one who runs it is known without pwd
    variables = {name: value for name, value in os.environ.items() if name not in names}
    return {**variables, "PYTHONPATH": path, "XDG_STATE_HOME": str(folder / "state")}


COMMAND = [sys.executable, "-m", "detent"]


def detent(elsewhere: Mapping[str, str], *words: str | Path) -> subprocess.CompletedProcess[str]:
    command = [*COMMAND, *map(str, words)]
    return subprocess.run(command, env=elsewhere, capture_output=True, text=True, check=False)


Answers = Mapping[str, tuple[int, str, str]]
ONE_BY_ONE = """
import contextlib, io, json, sys
from detent.cli import main
results = {}
for name, words in json.load(sys.stdin).items():
    out, err, status = io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(words)
        except SystemExit as end:
            status = end.code or 0
    results[name] = [status, out.getvalue(), err.getvalue()]
print(json.dumps(results))
"""


@pytest.fixture(scope="module")
def answers(
    elsewhere: Mapping[str, str], tmp_path_factory: pytest.TempPathFactory
) -> Mapping[str, tuple[int, str, str]]:
    """Status, output and errors of the commands below, which one process that lacks them was given in turn."""
    folder = str(tmp_path_factory.mktemp("made"))
    commands = {
        name: [word.format(folder=folder) for word in words]
        for name, (words, _) in (NEEDS_POSIX | RUN_ANYWHERE).items()
    }
    found = subprocess.run(
        [sys.executable, "-c", ONE_BY_ONE], env=elsewhere, input=json.dumps(commands), capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert (found.returncode, found.stderr) == (0, "")
    return {name: (status, out, err) for name, (status, out, err) in json.loads(found.stdout).items()}


def done(elsewhere: Mapping[str, str], *words: str | Path) -> str:
    found = detent(elsewhere, *words)
    assert (found.returncode, found.stderr) == (0, ""), found
    return found.stdout


@contextlib.contextmanager
def serving(elsewhere: Mapping[str, str], *words: str | Path) -> Iterator[Any]:
    """A verb that serves until it is ended; what it says with `--json` when it is ready."""
    command = [*COMMAND, *map(str, words), "--json"]
    process = subprocess.Popen(command, env=elsewhere, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        line = process.stdout.readline()
        assert line, process.communicate()[1]
        yield json.loads(line)
    finally:
        process.terminate()
        _, err = process.communicate()
    assert "Traceback" not in err, err


def test_the_process_really_lacks_them(elsewhere: Mapping[str, str]) -> None:
    code = f"""
import importlib
for name in {MISSING!r}:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        print(name)
"""
    found = subprocess.run([sys.executable, "-c", code], env=elsewhere, capture_output=True, text=True, check=True)
    assert found.stdout.split() == list(MISSING)


def test_they_are_asked_for_in_one_place() -> None:
    """But for the pseudo-terminal, which is loaded where one is made."""
    found = {
        str(path.relative_to("src/detent"))
        for path in Path("src/detent").rglob("*.py")
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in ([one.name for one in node.names] if isinstance(node, ast.Import) else [node.module])
        if name in MISSING
    }
    assert found == {"realtime/endpoints/pty.py", "realtime/endpoints/unsettler.py"}  # system.py tries them


def test_every_module_that_the_rest_needs_can_be_imported(elsewhere: Mapping[str, str]) -> None:
    code = (
        "import pkgutil, importlib, detent\n"
        "for found in pkgutil.walk_packages(detent.__path__, 'detent.'):\n"
        "    name = found.name\n"
        "    if name.endswith(('__main__', '.dense', '.lockstep', '.gpu_threads', 'endpoints.pty', '.unsettler'))"
        " or '.epics' in name or '.workbench' in name:\n"
        "        continue\n"
        "    importlib.import_module(name)\n"
    )
    found = subprocess.run([sys.executable, "-c", code], env=elsewhere, capture_output=True, text=True, check=False)
    assert (found.returncode, found.stderr) == (0, "")


def test_run(elsewhere: Mapping[str, str], tmp_path: Path) -> None:
    assert "ready" in done(elsewhere, "run", "gs-c200", "--send", "+100", "--vcd", tmp_path / "out.vcd")
    assert "bar" in done(elsewhere, "run", "examples/drilling/cell.toml", "--npz", tmp_path / "out.npz")


def test_a_unit_is_served_over_tcp_and_hosts_speak_to_it(elsewhere: Mapping[str, str], tmp_path: Path) -> None:
    with serving(elsewhere, "serve", "gs-c200", "--tcp", "127.0.0.1:0", "--state", tmp_path / "kept") as ready:
        port = ready["endpoints"][0]["address"]
        assert "< Y" in done(elsewhere, "send", "gs-c200", port, "P", "+100", "E")
        while "ready" not in done(elsewhere, "send", "gs-c200", port, "F"):  # it executes its program
            pass
        done(elsewhere, "backup", "gs-c200", port, tmp_path / "backup.toml")
    assert "+100" in (tmp_path / "backup.toml").read_text()
    assert list((tmp_path / "kept").glob("gs-c200*"))


def test_a_unit_is_served_as_a_remote_serial_port(elsewhere: Mapping[str, str], tmp_path: Path) -> None:
    with serving(elsewhere, "serve", "gs-c200", "--rfc2217", "127.0.0.1:0", "--state", tmp_path) as ready:
        address = ready["endpoints"][0]["address"]
        assert "ready" in done(elsewhere, "send", "gs-c200", address, "F")  # a host that knows nothing of RFC 2217
        assert "ready" in done(
            os.environ, "send", "gs-c200", f"rfc2217://{address}", "F"
        )  # serialx needs a real system


def test_without_pseudo_terminals_the_usual_endpoint_is_a_free_tcp_port(
    elsewhere: Mapping[str, str], tmp_path: Path
) -> None:
    with serving(elsewhere, "serve", "gs-c200", "--state", tmp_path) as ready:
        (endpoint,) = ready["endpoints"]
        assert endpoint["kind"] == "tcp"
        assert "ready" in done(elsewhere, "send", "gs-c200", endpoint["address"], "F")


def test_the_control_port_and_its_verbs(elsewhere: Mapping[str, str], tmp_path: Path) -> None:
    words = ("serve", "gs-c200", "--tcp", "127.0.0.1:0", "--control", "127.0.0.1:0", "--token", "a long secret")
    with serving({**elsewhere}, *words, "--state", tmp_path) as ready:
        control = {**elsewhere, "DETENT_TOKEN": "a long secret"}
        assert "gs-c200" in done(control, "control", ready["control"], "state")


RUN_ANYWHERE = {
    "boards": (["boards", "fake:rp2040"], "gpio0 to gpio29"),
    "boards check": (
        ["boards", "check", "examples/replacement/pico-dcb-274.toml", "--watch", "0", "--yes", "--steps", "20"],
        "plus  20 of 20 pulses",
    ),
    "service": (["service", "examples/drilling/cell.toml", "--user", "machine"], "User=machine"),
    "motor": (["motor"], "qsh4218-41-10-035"),
    "table": (["table"], "232 differences"),
    "asm": (["asm", "gs-c200", "examples/drilling/drill.gsc"], "A1"),
    "epics": (["epics", "gs-c200s", "--list-pvs"], "SIM:m1.RBV"),
    "completion": (["--install-completion", "--shell", "bash", "--output", "{folder}/detent.bash"], "Wrote"),
}


@pytest.mark.parametrize("name", RUN_ANYWHERE)
def test_verbs_that_need_no_part_of_posix(name: str, answers: Answers) -> None:
    if name == "epics":
        pytest.importorskip("caproto")
    status, out, err = answers[name]
    assert (status, "Traceback" in err) == (0, False), err
    assert RUN_ANYWHERE[name][1] in out


def test_a_machine_is_tuned_and_driven(elsewhere: Mapping[str, str], tmp_path: Path) -> None:
    """As far as a port that nobody serves, and pins of a fake board."""
    on = ["--witness", "UI1", "--step", "half", "--travel", "1200", "--moves", "1000", "--begin", "S=60", "T=400"]
    log = tmp_path / "trials.jsonl"
    found = detent(elsewhere, "tune", "gs-c200s", "--on", "127.0.0.1:1", *on, "R=300", "--log", log, "--yes")
    assert found.returncode == 1
    assert "127.0.0.1:1 cannot be opened" in found.stderr
    words = ("serve", "examples/replacement/pico-dcb-274.toml", "--real", "--state", tmp_path / "kept")
    with serving(elsewhere, *words) as ready:
        assert ready["axes"] == ["spindle"]


NEEDS_POSIX = {
    "service of nobody": (["service", "examples/drilling/cell.toml"], "say who runs the service"),
    "pty": (["serve", "gs-c200", "--pty", "{folder}/link"], "--tcp"),
    "serial": (["serve", "gs-c200", "--serial", "COM3"], "--tcp"),
    "rfc2217": (["send", "gs-c200", "rfc2217://127.0.0.1:1", "F"], "take HOST:PORT"),
    "device": (["send", "gs-c200", "/dev/ttyS0", "F"], "take HOST:PORT"),
    "backup": (["backup", "gs-c200", "/dev/ttyS0", "{folder}/kept.toml"], "take HOST:PORT"),
    "find": (["find"], "name a port yourself, as HOST:PORT"),
    "boards of a device": (["boards", "/dev/ttyACM0"], "need Linux or macOS"),
}


@pytest.mark.parametrize("name", NEEDS_POSIX)
def test_what_needs_posix_says_what_to_use_instead(name: str, answers: Answers) -> None:
    status, out, err = answers[name]
    said = out + err
    assert status in (1, 2)
    assert NEEDS_POSIX[name][1] in said
    assert said.count("\n") == 1, said


@pytest.mark.skipif(find_spec("nicegui") is None, reason="nicegui is not installed")
def test_the_workbench_with_an_engine_that_comes_over_loopback(elsewhere: Mapping[str, str], tmp_path: Path) -> None:
    browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())  # the token becomes a cookie
    words = ("workbench", "gs-c200", "--port", "0", "--state", tmp_path / "kept", "--folder", tmp_path)
    with serving(elsewhere, *words) as ready:
        with browser.open(ready["url"]) as page:
            assert "gs-c200" in page.read().decode()
        (endpoint,) = ready["endpoints"]
        assert "ready" in done(elsewhere, "send", "gs-c200", endpoint["address"], "F")
