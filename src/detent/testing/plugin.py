"""The pytest fixture `detent`. Loaded with every run of pytest, so it imports nothing before it is used."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from detent.testing.bench import Bench


@pytest.fixture
def detent(tmp_path: Path) -> "Iterator[Bench]":
    """Controllers and cells to test host software against: `detent.serve("gs-c200").port` is a serial port.

    What is served ends with the test, whatever happens. Non-volatile memories are files under `tmp_path`.
    """
    from detent.testing.bench import Bench

    with Bench(tmp_path) as bench:
        yield bench
