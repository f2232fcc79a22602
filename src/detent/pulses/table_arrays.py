"""The pulses of a table many at a time."""

from bisect import bisect_left

import numpy as np

from detent.pulses import arrays
from detent.pulses.segment import Int64Array
from detent.pulses.table import Table
from detent.ticks import Fixed


def fill(table: Table, out: Int64Array, first: int, start: Fixed) -> None:
    """Write the ns of the pulses first .. first + len(out) - 1."""
    rows, anchor, done, i = table.rows, start + table.anchor, 0, table.first + first
    row = bisect_left(rows.pulses_list, i) - 1
    while done < len(out):
        stop = min(row + arrays.CHUNK // 8, len(rows.counts))
        block = min(len(out) - done, arrays.CHUNK, int(rows.pulses_list[stop]) - i + 1)
        _fill_block(table, out[done : done + block], i, row, anchor)
        done, i = done + block, i + block
        row = bisect_left(rows.pulses_list, i) - 1


def _fill_block(table: Table, out: Int64Array, i: int, row: int, anchor: Fixed) -> None:
    """Write the ns of the pulses i .. i + len(out) - 1 of the whole table; `row` has pulse i."""
    rows, last = table.rows, i + len(out) - 1
    stop = bisect_left(rows.pulses_list, last)
    base = int(rows.ticks_list[row]) + (i - 1 - rows.pulses_list[row]) * int(rows.periods[row])
    counts = rows.counts[row:stop].copy()
    counts[0] = rows.pulses_list[row + 1] - i + 1
    counts[-1] -= rows.pulses_list[stop] - last
    ticks = np.repeat(rows.periods[row:stop], counts)
    np.cumsum(ticks, out=ticks)
    arrays.put_ticks(out, ticks, base, table.tick.numerator, table.tick.denominator, anchor)


def times_of(table: Table, n: Int64Array, start: Fixed) -> Int64Array:
    """The ns of the pulses `n` (1..steps each, any order)."""
    rows, i = table.rows, n + table.first
    row = np.searchsorted(rows.pulses, i) - 1
    ticks = (i - rows.pulses[row]) * rows.periods[row] + rows.ticks[row]
    out = np.empty(len(n), np.int64)
    arrays.put_ticks(out, ticks, 0, table.tick.numerator, table.tick.denominator, start + table.anchor)
    return out


def counts_by(table: Table, t: Int64Array, start: Fixed) -> Int64Array:
    """How many pulses have their ns at or before each of `t` (any order)."""
    rows = table.rows
    ticks = arrays.ticks_by(t, table.tick.numerator, table.tick.denominator, start + table.anchor)
    np.clip(ticks, 0, rows.ticks_list[-1], out=ticks)
    if not len(rows.counts):
        return np.zeros(len(t), np.int64)
    row = np.minimum(np.searchsorted(rows.ticks, ticks, side="right"), len(rows.counts)) - 1
    i = (ticks - rows.ticks[row]) // rows.periods[row] + rows.pulses[row]
    result: Int64Array = np.clip(i, table.first, table.last) - table.first
    return result
