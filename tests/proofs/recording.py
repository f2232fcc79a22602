"""The recording of a cell and its script, as text: ``python tests/proofs/recording.py [--without MODULE] FILE ...``.

Run by `test_determinism` under other hash seeds, other Pythons, and without what is optional.
"""

import sys
from pathlib import Path

MINUTE = 60 * 1_000_000_000


def main(words: list[str]) -> None:
    """Print every entry of the recordings of these cell files."""
    if words[:1] == ["--without"]:
        sys.modules[words[1]] = None  # type: ignore[assignment]
        words = words[2:]
    from detent.cell.build import build
    from detent.cell.description import parse

    for word in words:
        path = Path(word)
        cell = build(
            parse(path.read_text("utf-8"), path.name), lambda name, at=path: (at.parent / name).read_text("utf-8")
        )
        # what moves for ever is looked at for a while
        cell.run_to(MINUTE // 6)
        assert cell.recording is not None
        print(path.name, cell.now)
        for unit, entry in cell.recording:
            print(unit, entry)
            train = getattr(entry, "train", None)
            if train is not None:
                last = 200 if train.steps is None else train.steps
                print(*(train.time_of(pulse) for pulse in range(1, min(last, 200) + 1)))
        for part in cell.parts:
            trace = getattr(part, "trace", None)
            if trace is not None:
                print(repr(trace)[:100_000])


if __name__ == "__main__":
    main(sys.argv[1:])
