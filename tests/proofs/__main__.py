"""The proofs: ``python -m tests.proofs fuzz|chaos|soak``. Each is bounded in time and prints a table; 1 if it fails."""

import argparse
import os
import sys
import time

from tests.proofs import fuzz


def main() -> int:
    """Run the proof that is asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.proofs", description=__doc__)
    proofs = parser.add_subparsers(dest="proof", required=True)
    fuzzing = proofs.add_parser("fuzz", help="generated streams for units, cells and everything that reads")
    fuzzing.add_argument("--seconds", type=float, default=3600, help="end then at the latest")
    fuzzing.add_argument("--frames", type=int, default=10_000_000, help="end when there were so many")
    fuzzing.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    fuzzing.add_argument("--first", type=int, default=0, help="number of the first case: other numbers are other cases")
    asked = parser.parse_args()
    began = time.monotonic()
    found = fuzz.run(asked.seconds, asked.frames, asked.jobs, asked.first, lambda text: print(text, file=sys.stderr))
    fuzz.print_table(found, time.monotonic() - began)
    return any(tally.failures for tally in found.values())


if __name__ == "__main__":
    sys.exit(main())
