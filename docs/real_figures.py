"""Draw the picture of docs/how-to/replace-the-box.md: python docs/real_figures.py [FOLDER]. Each run draws the same."""

import sys
from pathlib import Path
from typing import Any

from detent.outputs.figures import COLOURS, GREY, INK, PALE, style

HERE = Path(__file__).parent
LEAD, NOTICED, BACK = 30.0, 3.0, 2.0  # ms: the lead; a stop is known to the host; the cell is taken back and run again
PERIOD = 4.0  # ms between pulses
COMMAND, SWITCH = 4.0, 56.0  # ms: the host's command; the switch closes at the machine
BLUE, RED, GREEN = COLOURS[0], COLOURS[1], COLOURS[2]


def path_of_a_pulse(figure: Any) -> None:
    """Above what a pulse goes through, below when: a command, its pulses in the cell and at the pin, and a stop."""
    above, below = figure.subplots(2, 1, height_ratios=(1, 2.6))
    _boxes(above)
    _times(below)


def _boxes(axes: Any) -> None:
    axes.set(xlim=(0, 100), ylim=(0, 10))
    axes.axis("off")
    stations = (
        ("host", "the old program", 0), ("cell", "the controller,\nin this computer", 20),
        ("link", "runs of steps,\nby USB", 40), ("board", "Klipper firmware:\nsteps at their tick", 60),
        ("driver", "and motor,\nswitches", 80),
    )  # fmt: skip
    for name, what, x in stations:
        colour = BLUE if name in ("cell", "link") else RED if name == "board" else GREY
        axes.add_patch(_box(x + 1, 2.2, 14, 6, colour))
        axes.text(x + 8, 6.6, name, ha="center", va="center", weight="bold", color=colour)
        axes.text(x + 8, 4.1, what, ha="center", va="center", size=7.5, color=INK, linespacing=1.25)
    arrow = {"arrowstyle": "-|>", "color": GREY, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0}
    for x in (15, 35, 55, 75):
        axes.annotate("", (x + 6, 6.2), (x, 6.2), arrowprops=arrow)
        axes.annotate("", (x, 3.6), (x + 6, 3.6), arrowprops=arrow)
    axes.text(50, 0.6, "pulses and outputs go to the right; what switches say and what the board counted comes back",
              ha="center", size=7.5, color=GREY)  # fmt: skip


def _box(x: float, y: float, width: float, height: float, colour: str) -> Any:
    from matplotlib.patches import FancyBboxPatch

    return FancyBboxPatch((x, y), width, height, boxstyle="round,pad=0,rounding_size=0.8", facecolor="white",
                          edgecolor=colour, linewidth=1.3)  # fmt: skip


def _times(axes: Any) -> None:
    rows = {"host": 3.0, "cell": 2.0, "pin": 1.0, "switch": 0.0}
    stop = SWITCH - LEAD  # as the cell has it
    pulses = [COMMAND + 2 + PERIOD * n for n in range(24)]
    for row in rows.values():
        axes.axhline(row, color=PALE, linewidth=0.8, zorder=0)
    axes.plot([COMMAND], [rows["host"]], "v", color=INK, markersize=7)
    axes.text(COMMAND + 1.2, rows["host"] + 0.12, "command", color=INK)
    known = SWITCH + NOTICED
    for at in pulses:
        if at > known:
            break
        taken_back = at > stop
        axes.vlines(at, rows["cell"], rows["cell"] + 0.42, color=PALE if taken_back else BLUE, linewidth=2)
        if not taken_back:
            axes.vlines(at + LEAD, rows["pin"], rows["pin"] + 0.42, color=RED, linewidth=2)
    first = pulses[0]
    axes.annotate("", (first + LEAD, rows["pin"] + 0.5), (first, rows["cell"] - 0.06),
                  arrowprops={"arrowstyle": "-|>", "color": GREY, "linewidth": 1})  # fmt: skip
    axes.text(first + 1, 1.5, "the lead, 30 ms: always the same", color=GREY, size=8, va="center")
    axes.plot([0, SWITCH, SWITCH, 94], [0.0, 0.0, 0.42, 0.42], color=GREEN, linewidth=1.6)
    axes.text(SWITCH - 1, 0.2, "a switch closes", color=GREEN, ha="right", va="center")
    axes.vlines(SWITCH, 0.42, 1.55, color=GREEN, linestyle=":", linewidth=1.2)
    axes.text(
        SWITCH + 1, 1.24, "the firmware stops the axis\nwithin two samples, 0.1 ms", color=RED, va="center", size=8
    )
    axes.annotate("", (stop, rows["cell"] + 0.66), (known, rows["cell"] + 0.66),
                  arrowprops={"arrowstyle": "-|>", "color": BLUE, "linewidth": 1.2})  # fmt: skip
    axes.vlines(known, rows["cell"], rows["cell"] + 0.74, color=BLUE, linestyle=":", linewidth=1.2)
    axes.text(known + 1, rows["cell"] + 0.5, "0.4 to 6 ms later the host knows:\nthe cell goes back to that pulse",
              color=BLUE, va="center", size=8)  # fmt: skip
    axes.text((stop + known) / 2, rows["cell"] + 0.22, "taken back: no step was made", color=GREY,
              ha="center", va="center", size=8, bbox={"facecolor": "white", "edgecolor": "none", "pad": 1})  # fmt: skip
    answer = stop + LEAD + 5 + NOTICED + BACK
    axes.plot([answer], [rows["host"]], "^", color=INK, markersize=7)
    axes.text(answer + 1.2, rows["host"] + 0.12, "answer: held until it is certain", color=INK)
    axes.set(xlim=(0, 94), ylim=(-0.3, 3.6), xlabel="ms")
    axes.set_yticks(list(rows.values()), ["host", "in the cell", "at the pin", "switch"])
    axes.tick_params(axis="y", length=0)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)


PICTURES = {"path-of-a-pulse.png": (path_of_a_pulse, 8.4, 5.0)}


def main(folder: Path) -> None:
    """Draw them."""
    with style():
        from matplotlib.figure import Figure

        for name, (draw, width, height) in PICTURES.items():
            figure = Figure(figsize=(width, height), layout="constrained")
            draw(figure)
            figure.savefig(folder / name, metadata={"Software": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "pictures")
