"""Value change dumps (IEEE 1364): what GTKWave, Surfer and sigrok read.

Timescale 1 ns, one scope a unit, wires named as its pins, and the commanded `position` as a signed integer.
An output without supply is x. A winding end of a driver on the board is a vector: the PWM counts it gets, which
change at every step; 256 counts a period are always on. The same signals give the same bytes.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from detent.outputs.files import MARK, open_whole
from detent.outputs.signals import Signals, UnitSignals, Watch, nobody_looks
from detent.outputs.waves import BEFORE_ALL
from detent.pulses.segment import Int64Array
from detent.ticks import Ns

Text = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]

_LEVELS = np.frombuffer(b"01x", np.uint8)
_COUNT_BITS = 9  # of the PWM counts of a winding: 0 to 256
_FIRST, _LAST = 33, 126  # identifiers are made of these printable characters
_GROUPS = np.array([list(b"%04d" % n) for n in range(10_000)], np.uint8)  # four decimal digits at a time


class _Rows(NamedTuple):
    """Changes in any order: when, the place in the instant, the number of the variable, its new value."""

    times: Int64Array
    order: Int64Array
    variables: Int64Array
    values: Int64Array


def write(path: Path, signals: Signals, watch: Watch = nobody_looks) -> None:
    """Write the file, whole or not at all. `watch` is told how far it is.

    ValueError for more pulses than can be written; OSError if it cannot be.
    """
    signals.pulse_count()
    with open_whole(path) as file:
        for piece in pieces(signals, watch):
            file.write(piece)


def size(signals: Signals) -> int:
    """About how many bytes the file will have."""
    time, total = len(str(signals.until)) + 2, 0
    for unit in signals.units:
        bits = max(abs(unit.motion.position(signals.until)), abs(unit.motion.start)).bit_length() + 1
        a_pulse = time + bits + 4 + sum(time // 2 + 4 for _ in unit.windings)
        total += unit.motion.pulse_count * (a_pulse + (time + 6 if unit.unlogged else 0))
        total += sum(len(unit.logged(pin).times) * (time + 3) for pin in unit.pins)
    return total


def pieces(signals: Signals, watch: Watch = nobody_looks) -> Iterator[bytes]:
    """The file in pieces, in order. ValueError for more pulses than can be written."""
    signals.pulse_count()
    dump = _Dump(signals)
    yield dump.header()
    now = 0
    for begin, end in signals.windows():
        rows = dump.rows(begin, end)
        if len(rows.times):
            yield dump.text(rows, now)
            now = int(rows.times.max())
        watch(min(end, signals.until), signals.until)
    if now < signals.until:
        yield b"#%d\n" % signals.until


class _Dump:
    """The variables of one file."""

    def __init__(self, signals: Signals) -> None:
        self._signals = signals
        count = sum(len(_levels(unit)) + len(unit.windings) + 1 for unit in signals.units)
        self._identifiers = [_identifier(number) for number in range(count)]
        self._id_width = max((len(identifier) for identifier in self._identifiers), default=1)
        padded = b"".join(identifier.ljust(self._id_width, b"\0") for identifier in self._identifiers)
        self._id_text = np.frombuffer(padded, np.uint8).reshape(-1, self._id_width)
        self._time_width = len(str(signals.until))
        self._bits = 32 if all(_fits(unit, 32) for unit in signals.units) else 64

    def header(self) -> bytes:
        """Everything up to the first change after 0, the levels before it included."""
        about = f"{MARK.decode()}. position: the commanded one, in steps."
        if any(unit.windings for unit in self._signals.units):
            about += " Winding ends: PWM counts, 256 counts a period."
        lines = [f"$comment {about} $end", "$timescale 1 ns $end"]
        initial = ["#0", "$dumpvars"]
        identifiers = (identifier.decode() for identifier in self._identifiers)
        for unit, scope in zip(self._signals.units, _scopes(self._signals.units), strict=True):
            lines.append(f"$scope module {scope} $end")
            for pin in _levels(unit):
                identifier = next(identifiers)
                lines.append(f"$var wire 1 {identifier} {_word(pin)} $end")
                initial.append(f"{'01x'[unit.level_before(pin, 0)]}{identifier}")
            for pin in unit.windings:
                identifier = next(identifiers)
                lines.append(f"$var wire {_COUNT_BITS} {identifier} {_word(pin)} $end")
                initial.append(f"b0 {identifier}")
            identifier = next(identifiers)
            lines += [f"$var integer {self._bits} {identifier} position $end", "$upscope $end"]
            initial.append(f"b{unit.motion.start % (1 << self._bits):b} {identifier}")
        return "\n".join([*lines, "$enddefinitions $end", *initial, "$end", ""]).encode()

    def rows(self, begin: Ns, end: Ns) -> _Rows:
        """All changes of a window, in order."""
        columns: list[_Rows] = []
        variable = 0
        for unit in self._signals.units:
            pulses = unit.pulses_for(begin, end)
            for pin in _levels(unit):
                one = unit.wave(pin, begin, end, pulses)
                if len(one.times):
                    same = np.full(len(one.times), variable, np.int64)
                    columns.append(_Rows(one.times, one.order, same, one.levels.astype(np.int64)))
                variable += 1
            for pin, driven in unit.windings.items():
                times, counts = driven.wave(pin, begin, end)
                if len(times):
                    first, same = np.full((2, len(times)), [[BEFORE_ALL], [variable]], np.int64)
                    columns.append(_Rows(times, first, same, counts))
                variable += 1
            times = pulses.times
            inside = slice(int(np.searchsorted(times, begin)), None)
            first = np.full(len(times[inside]), BEFORE_ALL, np.int64)
            same = np.full(len(first), variable, np.int64)
            columns.append(_Rows(times[inside], first, same, pulses.positions[inside]))
            variable += 1
        if not columns:
            return _Rows(*[np.empty(0, np.int64)] * 4)
        rows = _Rows(*(np.concatenate(parts) for parts in zip(*columns, strict=True)))
        index = np.lexsort((rows.order, rows.times))
        return _Rows(*(column[index] for column in rows))

    def text(self, rows: _Rows, now: Ns) -> bytes:
        """The changes as text; the last `#` written was `now`.

        Every row is laid out in columns of the same width, `#time`, newline, value, identifier, newline;
        what a row does not need of them is then left out.
        """
        new = np.diff(rows.times, prepend=now) != 0
        is_number = self._is_number()[rows.variables]
        is_level = ~is_number
        parts: list[tuple[Text, Mask]] = [_decimal(rows.times, self._time_width, new)]
        parts.append((np.where(is_level, _LEVELS[np.where(is_level, rows.values, 0)], ord("b"))[:, None], _all(rows)))
        if is_number.any():
            parts.append(_binary(np.where(is_number, rows.values, 0), self._bits, is_number))
        identifiers = self._id_text[rows.variables]
        parts += [(identifiers, identifiers != 0), (np.full((len(new), 1), 10, np.uint8), _all(rows))]
        text = np.concatenate([text for text, _ in parts], axis=1)
        wanted = np.concatenate([mask for _, mask in parts], axis=1)
        return bytes(text[wanted])

    def _is_number(self) -> Mask:
        units = self._signals.units
        kinds = (kind for unit in units for kind in [*[False] * len(_levels(unit)), *[True] * len(unit.windings), True])
        return np.array(list(kinds), np.bool_)


def _levels(unit: UnitSignals) -> list[str]:
    """The pins that are drawn as logic levels: a winding end has its counts instead."""
    return [pin for pin in unit.pins if pin not in unit.windings]


def _all(rows: _Rows) -> Mask:
    return np.ones((len(rows.times), 1), np.bool_)


def _decimal(times: Int64Array, width: int, wanted: Mask) -> tuple[Text, Mask]:
    """Rows of '#', the time, newline; a row that is not wanted has an empty mask."""
    text = np.empty((len(times), width + 2), np.uint8)
    mask = np.repeat(wanted[:, None], width + 2, axis=1)
    text[:, 0], text[:, -1] = ord("#"), ord("\n")
    rest, right = times, width + 1
    while right > 1:
        rest, group = np.divmod(rest, 10_000)
        left = max(right - 4, 1)
        text[:, left:right] = _GROUPS[group, 4 - (right - left) :]
        right = left
    for place in range(1, width):
        mask[:, width - place] &= times >= 10**place
    return text, mask


def _binary(values: Int64Array, bits: int, wanted: Mask) -> tuple[Text, Mask]:
    """Rows of two's complement digits and a blank, without leading zeros."""
    low, high = int(values.min()), int(values.max())
    width = bits if low < 0 else max(high.bit_length(), 1)
    shifted = values[:, None] >> np.arange(width - 1, -1, -1)
    text = np.empty((len(values), width + 1), np.uint8)
    np.bitwise_and(shifted, 1, out=text[:, :width], casting="unsafe")
    text[:, :width] += ord("0")
    text[:, -1] = ord(" ")
    mask = np.empty(text.shape, np.bool_)
    np.not_equal(shifted, 0, out=mask[:, :width])
    mask[:, -2:] = True
    mask &= wanted[:, None]
    return text, mask


def _fits(unit: UnitSignals, bits: int) -> bool:
    """Whether all positions are signed integers of so many bits."""
    ends = [unit.motion.start, *(span.shaft + span.direction * span.last for span in unit.motion.spans)]
    return all(-(1 << bits - 1) <= end < 1 << bits - 1 for end in ends)


def _identifier(number: int) -> bytes:
    """The short name of a variable in the file."""
    size = _LAST - _FIRST + 1
    name = bytes([_FIRST + number % size])
    while number >= size:
        number = number // size - 1
        name += bytes([_FIRST + number % size])
    return name


def _scopes(units: Sequence[UnitSignals]) -> list[str]:
    """The names of the units, made different where this format would make them alike."""
    found: list[str] = []
    for unit in units:
        name = _word(unit.name)
        number = 1
        while name in found:
            number += 1
            name = f"{_word(unit.name)}_{number}"
        found.append(name)
    return found


def _word(name: str) -> str:
    """A name without white space, which ends a name in this format, and without the $ that begins its keywords."""
    word = "_".join(name.split())
    return f"_{word[1:]}" if word.startswith("$") else word
