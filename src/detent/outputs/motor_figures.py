"""Figures of a motor: torque against speed, and one move with rotor, load angle and currents.

Need matplotlib, which is imported when a figure is made.
"""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from detent.motors.curve import PullOut
from detent.motors.drive import Drive
from detent.motors.motor import Motor
from detent.motors.move import Run
from detent.motors.named import Measured
from detent.outputs.figures import COLOURS, DPI, GREY, PALE, STAMPS, check, style
from detent.outputs.files import write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARGIN = 0.03  # left and right of a heading, as a part of the width
COMMAND, ROTOR, PHASE_A, PHASE_B, LOST = GREY, COLOURS[0], COLOURS[2], COLOURS[1], "#C0392B"


def write_curve(
    path: Path, motor: Motor, drive: Drive, points: Sequence[PullOut], measured: Measured | None = None
) -> None:
    """Draw a torque curve, and the maker's points where there are some. ValueError, ImportError, OSError."""
    with style():
        figure = _figure(9.0, 5.6)
        axes = figure.add_axes((0.09, 0.13, 0.87, 0.72))
        per_step = drive.winding.steps
        rates = [point.rate * per_step for point in points]
        shown = [point.torque for point in points]
        axes.plot(rates, shown, color=ROTOR, label="computed pull-out torque")
        if measured is not None and measured.winding == drive.winding.name:
            axes.plot(*zip(*measured.points, strict=True), "o", color=PHASE_B, markersize=5,
                      label=f"published: {measured.supply:g} V, {measured.current:g} A")  # fmt: skip
            shown += [torque for _, torque in measured.points]
        axes.axhline(motor.holding_torque, color=PALE, linestyle="--", linewidth=0.9, label="holding torque, rated")
        highest = max([motor.holding_torque, *shown])  # more current than the rated one gives more
        axes.set_ylim(0, 1.35 * highest)  # with room for the legend
        axes.set_xlim(left=0)
        label_axes(axes, f"{drive.winding.name} steps/s", "torque (Nm)")
        axes.legend(frameon=False, loc="upper right")
        fit = f", inductance x{motor.inductance_factor:.2f}" if motor.inductance_factor != 1 else ""
        _head(figure, f"{motor.name}: torque against speed",
              f"{drive.supply:g} V  ·  {drive.current:g} A  ·  {drive.winding.name} step  ·  {drive.decay} decay{fit}",
              )  # fmt: skip
        save(figure, path)


def write_move(path: Path, run: Run, title: str, about: str = "") -> None:
    """Draw a move that was simulated with a trace; `about` stands for its verdict. ValueError, ImportError, OSError."""
    with style():
        figure = _figure(12.0, 8.4)
        boxes = [(0.075, bottom, 0.9, height) for bottom, height in ((0.62, 0.27), (0.36, 0.2), (0.08, 0.22))]
        position, angle, current = (figure.add_axes(box) for box in boxes)
        times = run.times * 1e3
        position.step(times, run.command, where="post", color=COMMAND, linewidth=0.9, label="command")
        position.plot(times, run.rotor, color=ROTOR, label="rotor")
        position.legend(frameon=False, loc="upper left")
        label_axes(position, "", "position (full steps)")
        angle.plot(times, run.load_angles, color=ROTOR, linewidth=0.9)
        for limit in (-360, 360):
            angle.axhline(limit, color=LOST, linewidth=0.8, linestyle="--")
        worst = int(np.argmax(np.abs(run.load_angles)))
        angle.plot(times[worst], run.load_angles[worst], "o", color=LOST, markersize=5)
        most = max(400.0, 1.1 * float(np.abs(run.load_angles).max()))
        angle.set_ylim(-min(most, 1500), min(most, 1500))
        label_axes(angle, "", "load angle (el. degrees)")
        current.plot(times, run.trace[:, 3], color=PHASE_A, linewidth=0.8, label="phase A")
        current.plot(times, run.trace[:, 4], color=PHASE_B, linewidth=0.8, label="phase B")
        current.legend(frameon=False, loc="upper right")
        label_axes(current, "time (ms)", "current (A)")
        for axes in (position, angle, current):
            axes.set_xlim(times[0], times[-1])
        _head(figure, f"{run.rig.motor.name}: {title}", about or str(run.verdict))
        save(figure, path)


def blank(title: str, about: str, panels: int) -> "tuple[Figure, list[Axes]]":
    """A figure with a heading and empty panels one above the other."""
    figure = _figure(10.0, 1.6 + 2.8 * panels)
    _head(figure, title, about)
    room = (1 - 0.95 / figure.get_figheight()) / panels
    boxes = [(0.09, room * (panels - 1 - k) + 0.14 / panels, 0.88, room - 0.2 / panels) for k in range(panels)]
    return figure, [figure.add_axes(box) for box in boxes]


def _figure(width: float, height: float) -> "Figure":
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=DPI)


def _head(figure: "Figure", title: str, about: str) -> None:
    """A title, and a line about it: two where it is long. What is longer still is written smaller."""
    height = figure.get_figheight()
    room = (1 - 2 * MARGIN) * figure.bbox.width
    titled = figure.text(MARGIN, 1 - 0.36 / height, title, fontsize=14, fontweight="bold")
    lines = figure.text(MARGIN, 1 - 0.52 / height, about, fontsize=10, color=GREY, verticalalignment="top")
    if lines.get_window_extent().width > room:
        blanks = [k for k, letter in enumerate(about) if letter == " "]
        if blanks:
            middle = min(blanks, key=lambda k: abs(k - len(about) // 2))
            lines.set_text(f"{about[:middle]}\n{about[middle + 1 :]}")
    for text in (titled, lines):
        while (width := text.get_window_extent().width) > room:  # letters stand on whole pixels
            text.set_fontsize(float(text.get_fontsize()) * min(room / width, 0.98))


def label_axes(axes: "Axes", x: str, y: str) -> None:
    """Words at the axes, a grid, no frame."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(True)
    axes.spines[["top", "right"]].set_visible(False)


def save(figure: "Figure", path: Path) -> None:
    """Write the figure, whole or not at all. ValueError for another suffix, OSError."""
    check(path)
    data = BytesIO()
    kind = path.suffix.lower()[1:]
    figure.savefig(data, format=kind, metadata=STAMPS[kind])
    write_whole(path, data.getvalue())
