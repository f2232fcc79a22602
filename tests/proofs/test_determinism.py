"""The same cell and script give the same recording, byte for byte: whatever seeds hashes, whichever Python, with and
without numba."""

import os
import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

HERE = Path(__file__).parents[2]
ADDRESS = re.compile(rb" at 0x[0-9a-f]+")
SCRIPTED = sorted(HERE.glob("examples/*/*.toml"))
PLAIN = [path for path in SCRIPTED if "[motors" not in path.read_text("utf-8")]
MOVING = [path for path in SCRIPTED if "[motors" in path.read_text("utf-8")]
OTHERS = ("3.12", "3.13", "3.14")


def recording(python: str, *words: str, seed: str = "0") -> bytes:
    command = [python, str(HERE / "tests/proofs/recording.py"), *words]
    environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(HERE / "src")}
    done = subprocess.run(command, capture_output=True, env=environment, timeout=600, check=False)
    assert done.returncode == 0, done.stderr.decode()[-2000:]
    return ADDRESS.sub(b"", done.stdout)


@cache
def here() -> bytes:
    return recording(sys.executable, *map(str, PLAIN))


def test_the_recording_is_none_that_could_be_equal_by_chance() -> None:
    assert len(PLAIN) >= 8
    assert here().count(b"MotionStarted") > 50


@pytest.mark.parametrize("seed", ["1", "2", "4294967295"])
def test_the_seed_of_hashes_changes_nothing(seed: str) -> None:
    assert recording(sys.executable, *map(str, PLAIN), seed=seed) == here()


@pytest.mark.parametrize("version", OTHERS)
def test_another_python_changes_nothing(version: str) -> None:
    """One that has what Detent needs: ``make pythons`` makes them of those that are installed."""
    if sys.version_info[:2] == tuple(map(int, version.split("."))):
        pytest.skip("that is this one")
    python = HERE / ".venv" / f"python{version}" / "bin" / "python"
    if not python.exists():
        found = "" if shutil.which(f"python{version}") else f", and there is no python{version}"
        pytest.skip(f"no Python {version} has what Detent needs: make pythons{found}")
    assert recording(str(python), *map(str, PLAIN)) == here()


@pytest.mark.slow
def test_numba_changes_nothing() -> None:
    pytest.importorskip("numba")
    assert MOVING
    files = list(map(str, MOVING))
    assert recording(sys.executable, *files) == recording(sys.executable, "--without", "numba", *files)
