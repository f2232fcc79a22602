"""What happened in a cell, as the content of a file."""

import csv
import io
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from detent.outputs.signals import Signals
from detent.ticks import SECOND, Ns
from detent.workbench.scope import Scope, ScopeData, Trace

KINDS: Final = ("vcd", "sr", "npz", "csv", "png")
CSV_ROWS: Final = 20_000  # columns of time, at most
PNG_COLUMNS: Final = 2_400
_WIDTH, _LANE, _PANEL = 16.0, 0.32, 1.7  # inches


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


def table(scope: Scope, traces: Sequence[Trace], begin: Ns, end: Ns) -> bytes:
    """Rows of time and values. Within a row's time a trace went from its least to its most: two columns for each."""
    data = scope.columns([trace.key for trace in traces], begin, end, CSV_ROWS, begin)
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


def figure(scope: Scope, traces: Sequence[Trace], begin: Ns, end: Ns, title: str) -> bytes:
    """A picture of the traces: pins as lanes, everything else with an axis of its own."""
    from matplotlib.figure import Figure

    from detent.outputs.figures import COLOURS, GRID, INK

    data = scope.columns([trace.key for trace in traces], begin, end, PNG_COLUMNS, begin)
    heights = [_LANE if trace.digital else _PANEL for trace in traces]
    made = Figure(figsize=(_WIDTH, sum(heights) + 1.2), layout="constrained")
    made.suptitle(title, color=INK, x=0.01, ha="left", fontsize=11)
    panels = made.subplots(len(traces), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights})[:, 0]
    for k, (trace, axes) in enumerate(zip(traces, panels, strict=True)):
        colour = COLOURS[k % len(COLOURS)]
        axes.fill_between(data.times, data.low[k], data.high[k], color=colour, linewidth=0.8, step="mid", alpha=0.9)
        axes.set_ylabel(trace.key, rotation=0, ha="right", va="center", fontsize=8, color=INK)
        axes.set_title(trace.measure, loc="right", fontsize=7, pad=1, color=INK)
        axes.tick_params(labelsize=7, length=2)
        axes.grid(color=GRID, linewidth=0.6)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
        if trace.digital:
            axes.set_ylim(-0.2, 1.2)
            axes.set_yticks([])
    panels[-1].set_xlabel("s", fontsize=8)
    panels[-1].set_xlim(*_seconds(data, begin, end))
    content = io.BytesIO()
    made.savefig(content, format="png", dpi=110)
    return content.getvalue()


def _seconds(data: ScopeData, begin: Ns, end: Ns) -> tuple[float, float]:
    return begin / SECOND, max(end, begin + data.width) / SECOND
