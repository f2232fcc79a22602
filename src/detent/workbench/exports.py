"""What happened in a cell, as the content of a file."""

import csv
import io
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from detent.outputs.signals import Signals
from detent.workbench.scope import ScopeData, Trace

KINDS: Final = ("vcd", "sr", "npz", "csv")
CSV_ROWS: Final = 20_000  # columns of time, at most


def whole(kind: str, signals: Signals) -> bytes:
    """Everything, as vcd, sr or npz. ValueError where the format cannot hold it."""
    from detent.outputs import arrays, sigrok, vcd

    if kind == "vcd":
        return b"".join(vcd.pieces(signals))
    write: Callable[[Path, Signals], None] = sigrok.write if kind == "sr" else arrays.write
    with tempfile.TemporaryDirectory(prefix="detent-") as folder:
        path = Path(folder) / f"cell.{kind}"
        write(path, signals)
        return path.read_bytes()


def table(traces: Sequence[Trace], data: ScopeData) -> bytes:
    """Rows of time and values. Within a row's time a trace went from its least to its most: two columns for each."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    heads = [f"{trace.key} {what}{f' [{trace.measure}]' if trace.measure else ''}"
             for trace in traces for what in ("least", "most")]  # fmt: skip
    writer.writerow(["begin [ns]", "end [ns]", *heads])
    for k in range(data.columns):
        values = [row[k] for pair in zip(data.low, data.high, strict=True) for row in pair]
        if any(value == value for value in values):
            start = data.begin + k * data.width
            writer.writerow([start, start + data.width, *("" if v != v else f"{v:.9g}" for v in values)])
    return text.getvalue().encode()
