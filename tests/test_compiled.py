"""Compiled functions: from disk without what only compiles; compiled anew where nothing is kept, or it is broken."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("numba")

FUNCTION = "def total(values):\n    found = 0.0\n    for value in values:\n        found += value\n    return found\n"
CALL = """
import sys
import numpy as np
from detent.compiled import jit
from summing import total
made = jit(total)
print(made(np.arange(5.0)), made.stats.cache_hits.total(), "numba.np.linalg" in sys.modules)
"""
COMPILED, LOADED = "10.0 0 True", "10.0 1 False"


def called(folder: Path, **env: str) -> str:
    (folder / "summing.py").write_text(FUNCTION)
    return subprocess.run(
        [sys.executable, "-c", CALL], env={**os.environ, "PYTHONPATH": str(folder), **env}, check=True, text=True,
        capture_output=True,
    ).stdout.strip()  # fmt: skip


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the function and its machine code, which each test here leaves as whole as it was."""
    folder = tmp_path_factory.mktemp("compiled")
    assert called(folder, NUMBA_CACHE_DIR=str(folder / "kept")) == COMPILED
    return folder


def test_what_is_on_disk_is_run_without_what_only_compiles(compiled: Path) -> None:
    assert called(compiled, NUMBA_CACHE_DIR=str(compiled / "kept")) == LOADED


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
@pytest.mark.parametrize("broken", [b"", b"\x80\x04 not what it was"], ids=["cut", "garbage"])
def test_what_is_broken_on_disk_is_made_again(ending: str, broken: bytes, compiled: Path) -> None:
    kept = {"NUMBA_CACHE_DIR": str(compiled / "kept")}
    (file,) = (compiled / "kept").rglob(f"*.{ending}")
    file.write_bytes(broken)
    assert called(compiled, **kept) == COMPILED
    assert called(compiled, **kept) == LOADED


def test_where_nothing_can_be_kept_it_is_compiled(tmp_path: Path) -> None:
    nowhere = {"NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator", "NUMBA_CACHE_DIR": "/proc/nowhere"}
    assert called(tmp_path, **nowhere) == COMPILED
