"""Figures of tuned settings: where moves are lost over two of them, and settings beside each other.

Need matplotlib, which is imported when a figure is made.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from detent.outputs.figures import COLOURS, GREY, INK, style
from detent.outputs.motor_figures import blank, label_axes, save

Floats = npt.NDArray[np.float64]
LEVELS = 9  # contours of the time


def write_map(
    path: Path, x: Sequence[int], y: Sequence[int], lost: Floats, times: Floats, chosen: tuple[int, int], *,
    names: tuple[str, str], labels: tuple[str, str], title: str, about: str,
) -> None:  # fmt: skip
    """Draw loss rates (a row a y, a column an x), contours of the time in s, a star at `chosen`.

    `names` are those of the axes in short, `labels` say what they count.

    ValueError for another suffix, ImportError, OSError.
    """
    with style():
        figure, (axes,) = blank(title, about, 1)
        figure.set_size_inches(10.0, 7.0)
        axes.set_position((0.09, 0.1, 0.8, 0.74))
        figure.texts[0].set_y(1 - 0.36 / 7.0)
        figure.texts[1].set_y(1 - 0.62 / 7.0)
        from matplotlib.colors import LinearSegmentedColormap

        colours = LinearSegmentedColormap.from_list("lost", ["#EAF4EE", "#F6D9A8", "#D9822B", "#8E1B1B"])
        colours.set_bad("#DDDDDD")
        mesh = axes.pcolormesh(_edges(x), _edges(y), np.ma.masked_invalid(lost) * 100, cmap=colours, vmin=0, vmax=100)
        axes.set_xscale("log")
        axes.set_yscale("log")
        whole = np.isfinite(times)
        if whole.any() and min(lost.shape) > 1:
            low, high = float(np.nanmin(times)), float(np.nanmax(times))
            if high > low:
                levels = np.geomspace(low, high, LEVELS + 2)[1:-1]
                lines = axes.contour(x, y, np.ma.masked_invalid(times), levels=levels, colors=INK, linewidths=0.7)
                axes.clabel(lines, fmt=lambda value: f"{value:.3g} s", fontsize=8)
        axes.plot(*chosen, marker="*", markersize=17, color=COLOURS[0], markeredgecolor="white", linestyle="none",
                  label=f"chosen: {names[0]} {chosen[0]}, {names[1]} {chosen[1]}")  # fmt: skip
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False, borderpad=0)  # above: nothing is hidden
        label_axes(axes, *labels)
        _plain_ticks(axes)
        bar = figure.colorbar(mesh, cax=figure.add_axes((0.91, 0.1, 0.018, 0.74)))
        bar.set_label("variants that lose steps (%)")
        save(figure, path)


class Line(NamedTuple):
    """One of the settings that are compared: over the time (s) of its longest move, speed and torque used."""

    name: str
    times: Floats
    speeds: Floats  # steps/s
    used: Floats  # of the pull-out torque, 1 is all


def write_comparison(path: Path, lines: Sequence[Line], *, title: str, about: str) -> None:
    """Draw speed and torque used of settings beside each other. ValueError, ImportError, OSError."""
    with style():
        figure, (speed, used) = blank(title, about, 2)
        for k, line in enumerate(lines):
            colour = COLOURS[k % len(COLOURS)]
            speed.plot(line.times * 1e3, line.speeds, color=colour, label=line.name, linewidth=1.2)
            used.plot(line.times * 1e3, line.used * 100, color=colour, linewidth=1.2)
        speed.legend(frameon=False, loc="upper right")
        speed.set_ylim(bottom=0)
        for axes in (speed, used):
            axes.set_xlim(0, max(float(line.times[-1]) for line in lines) * 1.02e3)
        used.axhline(100, color=GREY, linewidth=0.8, linestyle="--")
        used.axhline(-100, color=GREY, linewidth=0.8, linestyle="--")
        label_axes(speed, "", "steps/s")
        label_axes(used, "time (ms)", "torque used (% of pull-out)")
        save(figure, path)


def _edges(values: Sequence[int]) -> Floats:
    """Between the values, even in logarithms."""
    at = np.log(np.asarray(values, np.float64))
    if len(at) == 1:
        at = np.array([at[0] - 0.1, at[0] + 0.1])
    between = (at[1:] + at[:-1]) / 2
    found: Floats = np.exp(np.concatenate(([2 * at[0] - between[0]], between, [2 * at[-1] - between[-1]])))
    return found


def _plain_ticks(axes: Any) -> None:
    """Numbers as people read them, on logarithmic axes that span little, too."""
    from matplotlib.ticker import FuncFormatter, LogLocator

    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 3, 5, 7)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(FuncFormatter(lambda value, _: ""))
