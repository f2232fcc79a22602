"""What a long move costs beside a short one: planning it, and the whole command ``detent run --json``."""

import subprocess
import sys
from functools import partial

from bench.rows import Row, measure
from detent.ramps.constant_acceleration import move

SHORT, LONG = 1_000, 999_999


def plan(steps: int) -> None:
    """A hundred different moves near `steps`, none of them kept from before."""
    for n in range(steps - 100, steps):
        move.__wrapped__(100, 10_000, 400, n)


def command(steps: int) -> None:
    """The move as a user runs it."""
    send = ["--send", "T1000", "--send", f"+{steps}"]
    subprocess.run([sys.executable, "-m", "detent", "run", "gs-c200", "--json", *send], check=True, capture_output=True)


def rows() -> list[Row]:
    """Each with the short move as its baseline; a ratio above 1.2 is too much."""
    made = []
    for name, what, scale, unit, repeat in (
        ("planning", plan, 1e4, "us", 20),
        ("run --json", command, 1e3, "ms", 7),
    ):
        short, long = measure(partial(what, SHORT), repeat) * scale, measure(partial(what, LONG), repeat) * scale
        made.append(Row(f"{name} of {LONG} steps", long, unit, f"of {SHORT} steps, {unit}", short, 1.2 * short))
    return made
