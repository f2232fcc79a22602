"""The proofs: ``python -m tests.proofs fuzz|chaos|soak``. Each is bounded in time and prints a table; 1 if it fails."""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

from tests.proofs import chaos, fuzz, soak


def main() -> int:
    """Run the proof that is asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.proofs", description=__doc__)
    proofs = parser.add_subparsers(dest="proof", required=True)
    fuzzing = proofs.add_parser("fuzz", help="generated streams for units, cells and everything that reads")
    fuzzing.add_argument("--seconds", type=float, default=3600, help="end then at the latest")
    fuzzing.add_argument("--frames", type=int, default=10_000_000, help="end when there were so many")
    fuzzing.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    fuzzing.add_argument("--first", type=int, default=0, help="number of the first case: other numbers are other cases")
    chaos_of = proofs.add_parser("chaos", help="kills, failing calls, power failures, full disks, bad lines")
    chaos_of.add_argument("--scale", type=int, default=40, help="how much of each; 1 is the short form")
    soaking = proofs.add_parser("soak", help="a day of virtual time, twice, and an hour of real time, under noise")
    soaking.add_argument("--hours", type=float, default=24, help="of virtual time")
    soaking.add_argument("--seconds", type=float, default=3600, help="of real time")
    asked = parser.parse_args()
    began = time.monotonic()
    if asked.proof == "chaos":
        rows = chaos.run(asked.scale, lambda text: print(text, file=sys.stderr))
        chaos.print_table(rows)
        return any(row.wrong for row in rows)
    if asked.proof == "soak":
        with tempfile.TemporaryDirectory(prefix="detent-soak-") as folder:
            return not soak.run(asked.hours, asked.seconds, Path(folder), soak.aloud)
    found = fuzz.run(asked.seconds, asked.frames, asked.jobs, asked.first, lambda text: print(text, file=sys.stderr))
    fuzz.print_table(found, time.monotonic() - began)
    return any(tally.failures for tally in found.values())


if __name__ == "__main__":
    sys.exit(main())
