"""What happened in a cell, as the content of a file."""

import csv
import io
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from detent.outputs.signals import Signals
from detent.ticks import Ns
from detent.workbench.beside import beside
from detent.workbench.mirror import Mirror
from detent.workbench.scope import Scope, ScopeData, Trace

KINDS: Final = ("vcd", "sr", "npz", "csv")
CSV_ROWS: Final = 20_000  # columns of time, at most


async def made(kind: str, mirror: Mirror, scope: Scope, keys: Sequence[str], first: Ns, last: Ns) -> bytes:
    """A file of a kind of `KINDS`, made beside the loop. `keys` and times are for csv; no keys: all axes.

    ValueError for another kind, an unknown trace, and where the format cannot hold it.
    """
    if kind not in KINDS:
        raise ValueError(f"there is no export {kind!r}; choose from {', '.join(KINDS)}")
    if kind != "csv":
        recording, views, until = mirror.recording(), mirror.views, mirror.until
        return await beside(lambda: whole(kind, Signals(recording, views, until)))
    chosen = [trace for trace in scope.traces if trace.key in keys or (not keys and not trace.digital)]
    if not chosen:
        raise ValueError("there is no such trace to export")
    data = scope.columns([trace.key for trace in chosen], first, last, CSV_ROWS, first)
    return await beside(table, chosen, data)  # the words of a million numbers take seconds


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
