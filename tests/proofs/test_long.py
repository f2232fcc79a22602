"""The short forms of ``make chaos`` and ``make soak``."""

from pathlib import Path

import pytest
from tests.proofs import chaos, soak

from detent.ticks import SECOND


@pytest.mark.slow
def test_chaos_in_short(tmp_path: Path) -> None:
    wrong = {row.name: row.wrong for row in chaos.rows(1, tmp_path) if row.wrong}
    assert not wrong


@pytest.mark.parametrize("seed", range(3))
def test_a_clock_that_jumps_costs_no_deadline(seed: int) -> None:
    chaos.the_clock_jumps(seed)


@pytest.mark.slow
def test_a_soak_in_short(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert soak.run(0.03, 5, tmp_path, soak.silent), capsys.readouterr().out


def test_some_minutes_of_a_soak_are_equal_to_the_same_again() -> None:
    first, second = (soak.virtual(20 * SECOND, 3, soak.silent) for _ in range(2))
    assert (first.pulses, first.digest) == (second.pulses, second.digest)
    assert first.digest != soak.virtual(20 * SECOND, 4, soak.silent).digest
