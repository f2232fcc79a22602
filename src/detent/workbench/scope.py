"""Everything that can be shown over time, in columns: the least and the most of each, so that no pulse is lost.

Columns stand on a grid: what was made of one stays true while time goes on, and is kept.
"""

from collections.abc import Callable, Sequence
from math import nan
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from detent.pins import PinKind
from detent.pulses.segment import Int64Array
from detent.ticks import Ns
from detent.workbench import rotors, signals
from detent.workbench.messages import Picture
from detent.workbench.mirror import Mirror

Floats = npt.NDArray[np.float64]

MOST_KEPT: Final = 40_000  # columns of one trace at one width
MOST_TRACES: Final = 96  # traces, each at one width, that are kept
_SERIES: Final = (100, 125, 160, 200, 250, 320, 400, 500, 640, 800)  # widths, by tens

_ROTOR: Final = {
    "place": (rotors.PLACE, "steps", "place of the rotor"),
    "command": (rotors.COMMAND, "steps", "place that the currents ask for"),
    "rotor_speed": (rotors.SPEED, "steps/s", "speed of the rotor"),
    "current_a": (rotors.CURRENT_A, "A", "current in phase A"),
    "current_b": (rotors.CURRENT_B, "A", "current in phase B"),
    "torque": (rotors.TORQUE, "Nm", "torque of the motor"),
}
_AXIS: Final = {
    "position": ("steps", "place that the pulses have commanded"),
    "speed": ("steps/s", "rate of the pulses, minus backwards"),
    "pulses": ("steps", "pulses given"),
}


class Trace(NamedTuple):
    """Something that can be shown."""

    key: str  # unique: bar.position, board.X.speed, bar.UO1, slide.current_a
    unit: str  # the unit or motor that it belongs to
    name: str  # position, speed, pulses, a pin, place, command, lag, rotor_speed, current_a, current_b or torque
    measure: str  # steps, steps/s, A, Nm; "" for a pin
    digital: bool  # a pin: 0, 1, nothing without supply
    help: str


class ScopeData(NamedTuple):
    """Columns: number i is from begin + i * width on (ns), `width` long. A row of `low` and `high` for each trace.

    NaN where nothing is known: before the history begins, behind now, a pin without supply. `low` equals `high` where
    nothing changed within the column.
    """

    begin: Ns
    width: Ns
    columns: int
    low: Floats  # (traces, columns)
    high: Floats

    @property
    def end(self) -> Ns:
        """The end of the last column."""
        return self.begin + self.columns * self.width

    @property
    def times(self) -> Floats:
        """The middle of each column, in seconds."""
        middles: Floats = np.arange(self.columns, dtype=np.float64) + 0.5
        return (self.begin + middles * self.width) * 1e-9


class Trigger(NamedTuple):
    """What is looked for: `rise`, `fall` or `edge` of a pin, `up` or `down` through `value`, or an `error`."""

    kind: str
    trace: str = ""  # its key; for an error the unit, or "" for any
    value: float = 0.0


class Kept(NamedTuple):
    """Columns of one trace at one width, from number `first` on, that will not change any more."""

    first: int
    low: Floats
    high: Floats


class Scope:
    """The traces of a mirror. `begin` is where its history begins."""

    def __init__(self, picture: Picture, mirror: Mirror) -> None:
        self._mirror = mirror
        self._curves: dict[str, signals.Curve] = {}
        self.traces: tuple[Trace, ...] = tuple(self._all(picture))
        self._by_key = {trace.key: trace for trace in self.traces}
        self._kept: dict[tuple[str, Ns], Kept] = {}
        self._cuts = 0

    def _all(self, picture: Picture) -> list[Trace]:
        found = []
        for name, unit in self._mirror.by_name.items():
            title = picture.units[name].title
            for axis, motions in unit.axes.items() if unit.view.line_format is not None else ():
                owner = f"{name}.{axis}" if axis else name
                for what, (measure, text) in _AXIS.items():
                    trace = Trace(f"{owner}.{what}", name, what, measure, False, f"{text} ({title})")
                    self._curves[trace.key] = signals.AXIS[what](motions)
                    found.append(trace)
            for pin in unit.view.pins:
                if pin.name in unit.changes and pin.kind is not PinKind.STRAP:
                    trace = Trace(f"{name}.{pin.name}", name, pin.name, "", True, pin.help)
                    self._curves[trace.key] = signals.PinCurve(unit, pin.name)
                    found.append(trace)
        for name, rows in self._mirror.motors.items():
            for what, (column, measure, text) in _ROTOR.items():
                trace = Trace(f"{name}.{what}", name, what, measure, False, text)
                self._curves[trace.key] = signals.RotorCurve(rows, lambda r, column=column: r[:, column])  # type: ignore[misc]
                found.append(trace)
            lag = Trace(f"{name}.lag", name, "lag", "steps", False, "how far the rotor is behind what is asked")
            self._curves[lag.key] = signals.RotorCurve(rows, _lag)
            found.append(lag)
        return found

    def curve(self, key: str) -> signals.Curve:
        """The trace as a function of time. KeyError for one that there is not."""
        try:
            return self._curves[key]
        except KeyError:
            raise KeyError(f"no trace {key!r}") from None

    def columns(self, keys: Sequence[str], begin: Ns, end: Ns, points: int, known: Ns) -> ScopeData:
        """See `Bench.scope`. What lies before `known` is not known."""
        mirror = self._mirror
        if self._cuts != mirror.cuts:
            self._cuts = mirror.cuts
            self._kept.clear()
        width = width_for(max(end - begin, 1), max(points, 2))
        first, last = max(begin, 0) // width, max(-(-end // width), max(begin, 0) // width + 1)
        rows = [self._trace(key, width, first, last, known) for key in keys]
        count = last - first
        low = np.array([row[0] for row in rows]).reshape(len(rows), count)
        high = np.array([row[1] for row in rows]).reshape(len(rows), count)
        return ScopeData(first * width, width, count, low, high)

    def _trace(self, key: str, width: Ns, first: int, last: int, known: Ns) -> tuple[Floats, Floats]:
        """Columns first .. last - 1 of a trace: what is kept, and the rest made anew."""
        curve, until = self.curve(key), self._mirror.until
        low, high = np.full(last - first, nan), np.full(last - first, nan)
        stop = min(last, until // width + 1)  # behind it nothing has happened
        start = max(first, known // width)
        if stop <= start:
            return low, high
        final = min(until // width, last)  # columns before this one are over
        kept = self._kept.pop((key, width), None)
        if kept is not None and not (kept.first <= start <= kept.first + len(kept.low)):
            kept = None
        if kept is None:
            made = curve.columns(width, start, stop, until)
            whole = Kept(start, *made)
        else:
            have = kept.first + len(kept.low)
            if have < stop:
                more = curve.columns(width, have, stop, until)
                whole = Kept(kept.first, np.concatenate((kept.low, more[0])), np.concatenate((kept.high, more[1])))
            else:
                whole = kept
        low[start - first : stop - first] = whole.low[start - whole.first : stop - whole.first]
        high[start - first : stop - first] = whole.high[start - whole.first : stop - whole.first]
        self._keep(key, width, whole, final)
        return low, high

    def _keep(self, key: str, width: Ns, whole: Kept, final: int) -> None:
        """Keep the columns that are over."""
        count = min(len(whole.low), max(final - whole.first, 0))
        skip = max(count - MOST_KEPT, 0)
        if count:
            self._kept[key, width] = Kept(whole.first + skip, whole.low[skip:count], whole.high[skip:count])
        while len(self._kept) > MOST_TRACES:
            del self._kept[next(iter(self._kept))]

    def search(self, trigger: Trigger, begin: Ns, end: Ns, most: int) -> list[Ns]:
        """See `Bench.search`. ValueError for a kind of trigger that the trace does not have."""
        end = min(end, self._mirror.until)
        if trigger.kind == "error":
            units = self._mirror.by_name
            chosen = list(units.values()) if not trigger.trace else [units[trigger.trace]]
            return sorted(told.at for unit in chosen for _, told in unit.refused if begin <= told.at <= end)[:most]
        curve = self.curve(trigger.trace)
        digital = self._by_key[trigger.trace].digital
        if trigger.kind in ("rise", "fall", "edge") and digital:
            ways = {"rise": (1,), "fall": (-1,), "edge": (1, -1)}[trigger.kind]
            return curve.crossings(0.5, ways, begin, end, most)
        if trigger.kind in ("up", "down") and not digital:
            return curve.crossings(trigger.value, (1,) if trigger.kind == "up" else (-1,), begin, end, most)
        takes = "rise, fall or edge" if digital else "up or down"
        raise ValueError(f"{trigger.trace} has no trigger {trigger.kind!r}; it takes {takes}")


def width_for(span: Ns, points: int) -> Ns:
    """The width of columns, the least of the series with which `span` takes at most `points` of them, less one."""
    least = -(-span // max(points - 1, 1))
    if least <= 100:
        return max(least, 1)
    scale = 1
    while 1000 * scale < least:
        scale *= 10
    return next(step * scale for step in (*_SERIES, 1000) if step * scale >= least)


def _lag(rows: Floats) -> Floats:
    lag: Floats = rows[:, rotors.COMMAND] - rows[:, rotors.PLACE]
    return lag


Ways = Sequence[int]
Pick = Callable[[Floats], Floats]
Times = Int64Array
