"""The distribution as users get it: built, and installed into a bare environment, with and without its extras."""

import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from detent import __version__
from detent.extras import EXTRAS

UV = shutil.which("uv") or str(Path(".uv/bin/uv").resolve())

pytestmark = pytest.mark.skipif(not Path(UV).is_file(), reason="uv is not there: `make setup` fetches it")


def run(*command: str | Path, **more: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False, **more)  # type: ignore[call-overload, no-any-return]


def must(*command: str | Path) -> str:
    done = run(*command)
    assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the wheel and the sdist."""
    folder = tmp_path_factory.mktemp("dist")
    must(sys.executable, "-m", "hatchling", "build", "-d", folder)
    return folder


@pytest.fixture(scope="module")
def wheel(built: Path) -> Path:
    (found,) = built.glob("*.whl")
    return found


class Environment:
    """A bare environment with the wheel and, of what it depends on, what one extra brings."""

    def __init__(self, folder: Path, wheel: Path, extra: str = "") -> None:
        self.python = folder / "bin" / "python"
        must(UV, "venv", "--quiet", "--python", sys.executable, folder)
        wanted = f"{wheel}[{extra}]" if extra else str(wheel)
        install = [UV, "pip", "install", "--quiet", "--python", self.python, "-c", "requirements.lock", wanted]
        if run(*install, "--offline").returncode:  # what set this checkout up is at hand; if not, it is fetched
            must(*install)
        self.detent = folder / "bin" / "detent"
        self.variables = {
            name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")
        }

    def __call__(self, *words: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
        return run(self.detent, *words, cwd=cwd, env=self.variables)


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory, wheel: Path) -> Environment:
    return Environment(tmp_path_factory.mktemp("bare") / "env", wheel)


def test_the_wheel_has_what_users_need_and_says_what_it_is(wheel: Path) -> None:
    assert wheel.name == f"detent_motion-{__version__}-py3-none-any.whl"
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        (about,) = (name for name in names if name.endswith(".dist-info/METADATA"))
        said = archive.read(about).decode()
    assert {"detent/py.typed", "detent/examples/drilling/cell.toml"} <= names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert any(name.endswith("licenses/NOTICE.md") for name in names)
    assert not any(name.startswith(("tests/", "bench/")) for name in names)
    for line in (
        "Name: detent-motion",
        "License-Expression: MIT",
        "Author: The Detent authors",
        "Classifier: Typing :: Typed",
    ):
        assert line in said, line


def test_the_sdist_can_be_built_from(built: Path, tmp_path: Path, wheel: Path) -> None:
    (archive,) = built.glob("*.tar.gz")
    with tarfile.open(archive) as opened:
        opened.extractall(tmp_path, filter="data")
    (folder,) = tmp_path.iterdir()
    assert {"LICENSE", "CHANGELOG.md", "tests", "docs", "src"} <= {path.name for path in folder.iterdir()}
    done = run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path / "again", cwd=folder)
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(wheel) as one, zipfile.ZipFile(tmp_path / "again" / wheel.name) as other:
        assert sorted(one.namelist()) == sorted(other.namelist())


def test_the_core_runs_without_any_extra(bare: Environment, tmp_path: Path) -> None:
    done = bare("run", "gs-c200", "--send", "F", "--vcd", tmp_path / "f.vcd", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "ready" in done.stdout
    assert "detent" in bare("--help", cwd=tmp_path).stdout
    assert bare("--version", cwd=tmp_path).stdout.strip() == __version__


RIG = ["--motor", "qsh4218-41-10-035", "--supply", "24", "--moves", "200"]
NEEDING: dict[str, list[list[str]]] = {
    "distributed": [["tune", "gs-c200", *RIG, "--workers", "2"]],
    "epics": [["epics", "gs-c200"]],
    "fast": [
        ["tune", "gs-c200", *RIG, "--gpu"],
        ["tune", "gs-c200", *RIG, "--fit"],
        ["tune", "gs-c200", "--batch", "ROWS"],
        ["compare-moves", "gs-c200", "S=48 T=603 R=201", "S=102 T=403 R=20", *RIG],
    ],
    "figures": [
        ["run", "gs-c200", "--send", "+10", "--plot", "p.png"],
        ["demo"],
        ["motor", *RIG[1:4], "--plot", "p.png"],
        ["tune", "gs-c200", *RIG, "--map", "m.png"],
        ["compare-moves", "gs-c200", "S=48 T=603 R=201", "S=102 T=403 R=20", *RIG, "--plot", "p.png"],
    ],
    "workbench": [["workbench", "gs-c200"]],
}
"""For each extra the commands that cannot do without. A motor is looked at without `fast`, slowly."""


@pytest.mark.parametrize(("extra", "words"), [(extra, words) for extra, all_ in NEEDING.items() for words in all_])
def test_a_verb_that_needs_an_extra_says_so_in_one_line(
    extra: str, words: list[str], bare: Environment, tmp_path: Path
) -> None:
    rows, folder = tmp_path / "rows.csv", tmp_path / "folder"
    rows.write_text("motor,moves\nqsh4218-41-10-035,200\n")
    folder.mkdir()
    done = bare(*(rows if word == "ROWS" else word for word in words), cwd=folder)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1, done.stderr
    assert f"{EXTRAS[extra]}, which is not installed: " in done.stderr
    assert f"'detent-motion[{extra}]'" in done.stderr
    assert not done.stdout
    assert list(folder.iterdir()) == []  # it is told before the work begins


@pytest.mark.slow
@pytest.mark.parametrize("extra", sorted(EXTRAS))
def test_each_extra_brings_what_it_says(extra: str, wheel: Path, tmp_path: Path) -> None:
    environment = Environment(tmp_path / "env", wheel, "distributed,fast" if extra == "distributed" else extra)
    must(environment.python, "-c", f"import {EXTRAS[extra]}")
    if extra == "figures":
        assert environment("run", "gs-c200", "--send", "+10", "--plot", "p.png", cwd=tmp_path).returncode == 0
        assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")
    elif extra == "fast":
        done = environment("motor", "qsh4218-41-10-035", "--supply", "24", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    elif extra == "epics":
        done = environment("epics", "gs-c200", "--list-pvs", cwd=tmp_path)
        assert "SIM:m1.VAL" in done.stdout, done.stderr
    elif extra == "distributed":
        done = environment("tune", "gs-c200", *RIG, "--workers", "2", "--variants", "16", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert "S=" in done.stdout
    elif extra == "workbench":
        process = subprocess.Popen(
            [environment.detent, "workbench", "gs-c200", "--port", "0"], cwd=tmp_path, env=environment.variables,
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        with process:
            assert process.stdout is not None
            assert any("http://127.0.0.1:" in line for line in process.stdout)
            process.terminate()
        assert process.returncode == 0
