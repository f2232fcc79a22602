"""The form of cell files, read by several threads at once: the workbench does, for each window."""

import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import pytest

from detent.cell import form
from detent.cell.description import Description, parse

READERS = 4


@pytest.fixture
def hasty() -> Iterator[None]:
    """Threads take turns as often as they can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.usefixtures("hasty")
def test_the_first_files_may_be_read_at_the_same_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(form, "_adapters", {})  # as nobody has read any
    begin = Barrier(READERS)

    def read(name: str) -> Description:
        begin.wait()
        return parse('[units.a]\nmodel = "gs-c200"\n', name)

    with ThreadPoolExecutor(READERS) as threads:
        found = list(threads.map(read, ["a", "b", "c", "d"]))
    assert [list(each.units) for each in found] == [["a"]] * READERS
