"""The figures of the SUPERSIGMA page show what the firmware does: their data can be made again."""

import runpy
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
SCRIPT = runpy.run_path(str(DOCS / "supersigma.py"))


def test_the_times_of_the_figure_are_those_of_the_movements() -> None:
    kept = (DOCS / "pictures" / "supersigma-times.csv").read_text()
    assert SCRIPT["as_csv"](SCRIPT["times"](20)) == kept, "run python docs/supersigma.py"
    rows = [
        dict(zip(kept.splitlines()[0].split(","), map(float, line.split(",")), strict=True))
        for line in kept.splitlines()[1:]
    ]
    assert all(row["free us"] <= row["exact us"] <= row["hyperbola us"] for row in rows)


def test_the_pictures_can_be_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    SCRIPT["draw_times"](SCRIPT["times"](200), tmp_path / "times.png")
    SCRIPT["draw_family"](tmp_path / "family.png")
    assert all((tmp_path / name).stat().st_size > 10_000 for name in ("times.png", "family.png"))
