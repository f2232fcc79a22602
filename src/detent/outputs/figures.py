"""Figures of a whole run: every axis with its position and speed, and below it what the wires said.

Needs matplotlib, which is imported when a figure is made. The same signals give the same picture.
"""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from detent.extras import need
from detent.outputs import curves
from detent.outputs.curves import Band
from detent.outputs.files import MARK, write_whole
from detent.outputs.rotors import RotorTrace
from detent.outputs.signals import Signals, UnitSignals
from detent.outputs.waves import UNKNOWN
from detent.ticks import MS, SECOND, US, Ns

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = (".png", ".svg", ".pdf")
MOST_LANES = 20  # when nobody has chosen them
EARLY = 500  # a pin that changes only in the first 500th of a run is not chosen

# Okabe and Ito: told apart by everybody, and in print.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#B8860B", "#56B4E9")
BUSY = 0.55  # how opaque a colour is where too much happens for lines
CROWDED = 6  # a line that bends oftener than once in so many columns is drawn thin
_HATCHED = {"facecolor": "none", "edgecolor": "#CCCCCC", "hatch": "/////"}
INK, GREY, PALE, GRID = "#222222", "#666666", "#BBBBBB", "#E6E6E6"

# All in pixels.
DPI = 100
WIDTH, LEAST_HEIGHT = 1600, 1000
LEFT, RIGHT, TOP, BOTTOM = 300, 110, 92, 62
POSITION, SPEED, GAP, BLOCK_GAP = 96, 68, 12, 26  # a unit's two panels, the gap between them and behind them
MOST_STRETCH = 2.4  # of the panels when there are few
LANE, LANES_GAP = 34, 10
LEAST_BAND = 3  # a shorter band has no box of its own
STUB = 8  # behind the end of the run, so that levels taken at the very end are seen


class Pin(NamedTuple):
    """A lane: the level of a pin. Without words of your own: UNIT.PIN and the help of the pin."""

    unit: str
    pin: str
    label: str = ""
    meaning: str = ""


class Strip(NamedTuple):
    """A lane of bands with words in them."""

    unit: str  # gives the colour
    label: str
    meaning: str
    bands: Sequence[Band]


STAMPS: dict[str, dict[str, Any]] = {
    "png": {"Software": MARK.decode()},
    "svg": {"Date": None, "Creator": MARK.decode()},
    "pdf": {"CreationDate": None, "Creator": MARK.decode()},
}
"""What a figure says of itself: who made it, and not when, so that the same run gives the same bytes."""


def check(path: Path) -> None:
    """ValueError if no figure can be written to a file of this name, MissingExtra if none can be drawn here."""
    if path.suffix.lower() not in FORMATS:
        shown = f"{path.suffix!r}" if path.suffix else "no suffix"
        raise ValueError(f"{path}: a figure is one of {', '.join(FORMATS)}, not {shown}: choose another file name")
    need("figures", "figures need")


def write(
    path: Path,
    signals: Signals,
    *,
    title: str = "",
    lanes: Sequence[Pin | Strip] | None = None,
    rotors: Sequence[RotorTrace] = (),
) -> None:
    """Draw a run into a .png, .svg or .pdf file, whole or not at all.

    ValueError for another suffix, KeyError for a lane that is none, ImportError without matplotlib, OSError if
    the file cannot be written.
    """
    check(path)
    figure = timeline_figure(signals, title=title, lanes=lanes, rotors=rotors)
    data = BytesIO()
    with style():
        kind = path.suffix.lower()[1:]
        figure.savefig(data, format=kind, metadata=STAMPS[kind])
    write_whole(path, data.getvalue())


def timeline_figure(
    signals: Signals,
    *,
    title: str = "",
    lanes: Sequence[Pin | Strip] | None = None,
    rotors: Sequence[RotorTrace] = (),
) -> "Figure":
    """A figure of the whole run.

    `lanes` from top to bottom; None: the programs, and the pins that change (`chosen_lanes`). KeyError for a
    unit or pin that was not recorded, ImportError without matplotlib.
    """
    with style():
        from matplotlib.figure import Figure

        chosen = chosen_lanes(signals) if lanes is None else list(lanes)
        return _Timeline(Figure, signals, chosen, rotors).draw(title)


def chosen_lanes(signals: Signals) -> list[Pin | Strip]:
    """Strips for executed programs and for windings; then pins that change, but no step clocks and serial wires."""
    strips: list[Pin | Strip] = []
    for unit in signals.units:
        bands = curves.instructions(signals, unit.name)
        if bands:
            strips.append(Strip(unit.name, f"{unit.name} program", "instruction being executed", bands))
        for driven in dict.fromkeys(unit.windings.values()):
            about = f"power of the windings at {driven.connector}; white: off"
            strips.append(Strip(unit.name, f"{unit.name}.{driven.connector} power", about,
                                curves.powers(driven, signals.until)))  # fmt: skip
    pins: list[Pin | Strip] = []
    for unit in signals.units:
        clocks = set(unit.view.pulse_output.clocks) if unit.view.pulse_output is not None else set()
        quiet = {*clocks, unit.view.port.sends, unit.view.port.receives}
        moving = [pin for pin in unit.pins if pin not in quiet and _changes(unit, pin, signals.until)]
        pins += [Pin(unit.name, pin) for pin in moving[: max((MOST_LANES - len(strips)) // len(signals.units), 2)]]
    return strips + pins


def _changes(unit: UnitSignals, pin: str, until: Ns) -> bool:
    levels = unit.wave(pin, until // EARLY + 1).levels
    return bool((levels != UNKNOWN).any())


def style() -> Any:
    """The settings of all our figures, whatever the user's own are."""
    need("figures", "figures need")
    import matplotlib

    keep_out = {"backend", "backend_fallback", "interactive", "toolbar", "timezone"}
    settings: dict[Any, Any] = {key: value for key, value in matplotlib.rcParamsDefault.items() if key not in keep_out}
    return matplotlib.rc_context(settings | _SETTINGS)


_SETTINGS = {
    "font.family": "DejaVu Sans", "font.size": 9, "text.color": INK, "svg.hashsalt": "detent", "svg.fonttype": "path",
    "axes.edgecolor": PALE, "axes.linewidth": 0.8, "axes.labelcolor": GREY, "axes.axisbelow": True,
    "xtick.color": PALE, "ytick.color": PALE, "xtick.labelcolor": GREY, "ytick.labelcolor": GREY,
    "xtick.labelsize": 9, "ytick.labelsize": 8, "xtick.major.size": 4, "ytick.major.size": 3,
    "grid.color": GRID, "grid.linewidth": 0.8, "lines.linewidth": 1.4, "lines.solid_joinstyle": "round",
    "figure.dpi": DPI, "savefig.dpi": DPI, "path.simplify": True,
}  # fmt: skip


class _Timeline:
    """One figure being drawn."""

    def __init__(self, figure: "type[Figure]", signals: Signals, lanes: Sequence[Pin | Strip],
                 rotors: Sequence[RotorTrace] = ()) -> None:  # fmt: skip
        self.signals, self.lanes, self.rotors = signals, lanes, rotors
        self.colours = {unit.name: COLOURS[n % len(COLOURS)] for n, unit in enumerate(signals.units)}
        self.until = max(signals.until, 1)
        self.scale, self.time_unit = _time_unit(self.until)
        moving = [unit for unit in signals.units if unit.moves]
        self.axes_units = moving
        lanes_height = LANE * len(lanes) + LANES_GAP if lanes else 0
        fixed = TOP + BOTTOM + lanes_height + (len(moving) + len(rotors)) * (GAP + BLOCK_GAP)
        panels = (len(moving) + len(rotors)) * (POSITION + SPEED)
        stretch = min(max((LEAST_HEIGHT - fixed) / panels, 1.0), MOST_STRETCH) if panels else 1.0
        self.position, self.speed = round(POSITION * stretch), round(SPEED * stretch)
        self.height = fixed + (len(moving) + len(rotors)) * (self.position + self.speed)
        self.columns = WIDTH - LEFT - RIGHT - STUB
        self.horizon = self.until * (WIDTH - LEFT - RIGHT) / self.columns
        self.figure = figure(figsize=(WIDTH / DPI, self.height / DPI), dpi=DPI)
        self.top = self.height - TOP  # where the next panel begins, from below

    def draw(self, title: str) -> "Figure":
        """Everything, from top to bottom."""
        self.head(title)
        axes: Axes | None = None
        for unit in self.axes_units:
            self.unit_name(unit)
            axes = self.position_panel(unit)
            self.top -= GAP
            axes = self.speed_panel(unit)
            self.top -= BLOCK_GAP
        for rotor in self.rotors:
            axes = self.rotor_panels(rotor)
            self.top -= BLOCK_GAP
        if self.lanes:
            axes = self.lanes_panel()
        if axes is not None:
            axes.tick_params(axis="x", labelbottom=True, length=4)
            axes.set_xlabel(f"time ({self.time_unit})", fontsize=10, labelpad=6)
        return self.figure

    def head(self, title: str) -> None:
        """Title, and the run in figures."""
        units, pulses = len(self.signals.recording.units), sum(unit.motion.pulse_count for unit in self.signals.units)
        about = [
            f"{units} unit{'s' * (units != 1)}", f"{_number(self.signals.until / self.scale)} {self.time_unit}",
            f"{_number(pulses)} step pulse{'s' * (pulses != 1)}",
        ]  # fmt: skip
        self.text(24, self.height - 38, title or "Detent run", fontsize=16, fontweight="bold")
        self.text(24, self.height - 62, "  ·  ".join(about), fontsize=10, color=GREY)

    def unit_name(self, unit: UnitSignals) -> None:
        """The name of a unit, beside its panels."""
        self.text(24, self.top - 14, unit.title, fontsize=14, fontweight="bold", color=self.colours[unit.name])

    def position_panel(self, unit: UnitSignals) -> "Axes":
        """Where the axis is."""
        axes = self.panel(self.position)
        self.text(24, self.top + self.position - 38, "position (steps)", color=GREY)
        trace = curves.position_trace(unit, self.until, self.columns)
        colour = self.colours[unit.name]
        axes.plot(trace.times / self.scale, trace.values, color=colour)
        _limits(axes, trace.values)
        _whole_ticks(axes, 5)
        end = float(trace.values[-1])
        self.beside(axes, end, _number(end), colour, "at the end")
        return axes

    def speed_panel(self, unit: UnitSignals) -> "Axes":
        """How fast the axis is, plus is clockwise."""
        axes = self.panel(self.speed)
        self.text(24, self.top + self.speed - 18, "speed (steps/s)", color=GREY)
        trace = curves.speed_trace(unit, self.until, self.columns)
        colour = self.colours[unit.name]
        if len(unit.motion.spans) > self.columns // CROWDED:
            low, high = curves.envelope(trace, self.until, self.columns)
            axes.fill_between(low.times / self.scale, low.values, high.values, color=colour, alpha=BUSY, linewidth=0)
        else:
            times = trace.times / self.scale
            axes.fill_between(times, trace.values, color=colour, alpha=0.14, linewidth=0)
            axes.plot(times, trace.values, color=colour, linewidth=1.2)
        axes.axhline(0, color=PALE, linewidth=0.8, zorder=1)
        _limits(axes, trace.values)
        _whole_ticks(axes, 4)
        if trace.values.any():
            peak = float(trace.values[np.argmax(np.abs(trace.values))])
            self.beside(axes, peak, _number(peak), colour, "fastest")
        else:
            axes.set_yticks([0])
            axes.text(0.5, 0.75, "no step pulses", transform=axes.transAxes, ha="center", va="center", color=GREY)
        return axes

    def rotor_panels(self, rotor: RotorTrace) -> "Axes":
        """Where the rotor of a motor is, where it should be, and the currents of its phases."""
        self.text(24, self.top - 14, rotor.name, fontsize=14, fontweight="bold", color=INK)
        axes = self.panel(self.position)
        self.text(24, self.top + self.position - 38, "rotor (steps)", color=GREY)
        self.text(24, self.top + self.position - 54, "grey: command", color=GREY)
        times = rotor.times / self.scale
        axes.plot(times, rotor.commands, color=PALE, drawstyle="steps-post", linewidth=1.2)
        axes.plot(times, rotor.places, color=INK, linewidth=0.9)
        _limits(axes, np.concatenate((rotor.places, rotor.commands)))
        _whole_ticks(axes, 5)
        end = float(rotor.places[-1])
        self.beside(axes, end, _number(round(end, 2)), INK, "at the end")
        self.top -= GAP
        axes = self.panel(self.speed)
        self.text(24, self.top + self.speed - 18, "phase currents (A)", color=GREY)
        for current, colour in ((rotor.current_a, COLOURS[2]), (rotor.current_b, COLOURS[1])):
            axes.plot(times, current, color=colour, linewidth=0.5)
        return axes

    def lanes_panel(self) -> "Axes":
        """All lanes."""
        axes = self.panel(LANE * len(self.lanes) + LANES_GAP)
        axes.set_ylim(0, LANE * len(self.lanes) + LANES_GAP)
        axes.set_yticks([])
        axes.spines["left"].set_visible(False)
        for n, chosen in enumerate(self.lanes):
            low = LANE * (len(self.lanes) - 1 - n) + LANES_GAP
            unit = self.signals.unit(chosen.unit)
            colour = self.colours[chosen.unit]
            if isinstance(chosen, Strip):
                label, meaning = chosen.label, chosen.meaning
                self.strip(axes, low, chosen.bands, colour)
            else:
                if chosen.pin not in unit.pins:
                    raise KeyError(f"{chosen.unit} has no wire {chosen.pin!r} to draw: it has {', '.join(unit.pins)}")
                label = chosen.label or f"{chosen.unit}.{chosen.pin}"
                meaning = chosen.meaning or unit.pins[chosen.pin].help
                self.wire(axes, low, unit, chosen.pin, colour)
            y = self.top + low
            self.text(LEFT - 14, y + 17, _shortened(label, 34), ha="right", color=colour, fontweight="bold")
            self.text(LEFT - 14, y + 5, _shortened(meaning, 50), ha="right", color=GREY, fontsize=7.5)
        return axes

    def wire(self, axes: "Axes", low: float, unit: UnitSignals, pin: str, colour: str) -> None:
        """The level of a pin: filled while it is 1, hatched while it is unknown, a block where it is too fast."""
        lane = curves.lane(unit, pin, self.until, self.columns)
        begins = lane.times / self.scale
        ends = np.append(begins[1:], self.horizon / self.scale)
        floor, height = low + 4.0, LANE - 14.0
        for level, look in ((1, {"facecolor": colour, "alpha": 0.18}), (UNKNOWN, _HATCHED)):
            shown = lane.levels == level
            bars = list(zip(begins[shown], (ends - begins)[shown], strict=True))
            axes.broken_barh(bars, (floor, height), linewidth=0, **look)
        heights = np.where(lane.levels == UNKNOWN, np.nan, floor + lane.levels * height)
        corners = np.column_stack((begins, ends)).ravel()
        crowded = len(begins) > self.columns // CROWDED
        axes.plot(corners, np.repeat(heights, 2), color=colour, linewidth=0.4 if crowded else 1.2)
        least = self.until // self.columns
        busy = [(begin / self.scale, max(end - begin, least) / self.scale) for begin, end in lane.busy]
        axes.broken_barh(busy, (floor, height), facecolor=colour, alpha=BUSY, linewidth=0)

    def strip(self, axes: "Axes", low: float, bands: Sequence[Band], colour: str) -> None:
        """Bands, and their words where there is room; a block where they are too short to be told apart."""
        floor, height = low + 3.0, LANE - 10.0
        boxes: list[tuple[float, float]] = []
        blocks: list[tuple[Ns, Ns]] = []
        for band in bands:
            room = (band.end - band.begin) * self.columns / self.until
            if room < LEAST_BAND:
                begin = blocks.pop()[0] if blocks and blocks[-1][1] == band.begin else band.begin
                blocks.append((begin, band.end))
                continue
            boxes.append((band.begin / self.scale, (band.end - band.begin) / self.scale))
            if 6.2 * len(band.label) + 4 <= room:
                middle = (band.begin + band.end) / 2 / self.scale
                axes.text(middle, floor + height / 2, band.label, ha="center", va="center_baseline", fontsize=7.5)
        short = [(begin / self.scale, (end - begin) / self.scale) for begin, end in blocks]
        axes.broken_barh(boxes, (floor, height), facecolor=_tint(colour), edgecolor=colour, linewidth=0.6)
        axes.broken_barh(short, (floor, height), facecolor=colour, alpha=BUSY, linewidth=0)

    def panel(self, height: int) -> "Axes":
        """Axes of this height below everything drawn so far."""
        self.top -= height
        box = (LEFT / WIDTH, self.top / self.height, (WIDTH - LEFT - RIGHT) / WIDTH, height / self.height)
        axes = self.figure.add_axes(box)
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_xlim(0, self.horizon / self.scale)
        _locate(axes.xaxis, 10)
        axes.xaxis.set_major_formatter(lambda value, _: _number(value))
        axes.tick_params(axis="x", labelbottom=False, length=0)
        axes.grid(axis="both")
        return axes

    def text(self, x: float, y: float, words: str, **style: Any) -> None:
        """Words at a place in pixels from the lower left corner."""
        self.figure.text(x / WIDTH, y / self.height, words, **style)

    def beside(self, axes: "Axes", y: float, words: str, colour: str, meaning: str) -> None:
        """A value at its height, right of the axes, and what it is."""
        low, high = axes.get_ylim()
        place = min(max((y - low) / (high - low), 0.16), 0.86)
        middle = self.top + place * axes.bbox.height
        self.text(WIDTH - RIGHT + 12, middle + 2, words, color=colour, fontweight="bold")
        self.text(WIDTH - RIGHT + 12, middle - 2, meaning, color=GREY, fontsize=7.5, va="top")


def _time_unit(until: Ns) -> tuple[Ns, str]:
    """The unit in which a run of this length is read best."""
    minute, hour = 60 * SECOND, 3600 * SECOND
    for scale, name in ((hour, "h"), (minute, "min"), (SECOND, "s"), (MS, "ms"), (US, "µs")):
        if until >= 2 * scale:
            return scale, name
    return 1, "ns"


def _number(value: float) -> str:
    """A number with thin blanks between thousands."""
    text = f"{value:,.0f}" if abs(value) >= 1e4 or value == round(value) else f"{value:,.4g}"
    return text.replace(",", "\u2009").replace("-", "\u2212")


def _shortened(text: str, most: int) -> str:
    """The text, or as many of its first words as there is room for."""
    if len(text) <= most:
        return text
    words, blank, _ = text[:most].rpartition(" ")
    return (words if blank else text[: most - 1]) + "…"


def _tint(colour: str) -> tuple[float, ...]:
    """A light shade that hides what is behind it."""
    from matplotlib.colors import to_rgb

    return tuple(1 - 0.16 * (1 - part) for part in to_rgb(colour))


def _limits(axes: "Axes", values: Any) -> None:
    """Room above and below the values, at least one step of it."""
    low, high = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
    room = max((high - low) * 0.08, 1.0)
    axes.set_ylim(low - room, high + room)


def _whole_ticks(axes: "Axes", most: int) -> None:
    _locate(axes.yaxis, most)
    axes.yaxis.set_major_formatter(lambda value, _: _number(value))


def _locate(axis: Any, most: int) -> None:
    from matplotlib.ticker import MaxNLocator

    axis.set_major_locator(MaxNLocator(most, steps=[1, 2, 2.5, 5, 10], integer=axis.axis_name == "y"))
