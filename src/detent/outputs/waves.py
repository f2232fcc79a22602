"""Waveforms of single wires as arrays: when a level begins, and which; characters turned into their bits."""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from detent.pulses.segment import Int64Array
from detent.ticks import Ns
from detent.uart import Char, Format

Levels: TypeAlias = npt.NDArray[np.uint8]

UNKNOWN = 2  # the level of an output whose unit has no supply; 0 and 1 are themselves
BEFORE_ALL = -1  # the place of a step pulse in its instant


class Wave(NamedTuple):
    """Changes of one wire in order of time: from times[i] on it has levels[i].

    `order` is the place in the recording, which settles what comes first in one instant.
    """

    times: Int64Array
    levels: Levels
    order: Int64Array

    def level_before(self, t: Ns, otherwise: int) -> int:
        """The level just before `t`; `otherwise` where nothing has changed yet."""
        index = int(np.searchsorted(self.times, t, side="left"))
        return int(self.levels[index - 1]) if index else otherwise

    def between(self, begin: Ns, end: Ns) -> "Wave":
        """The changes with begin <= time < end."""
        low, high = np.searchsorted(self.times, (begin, end), side="left").tolist()
        return Wave(self.times[low:high], self.levels[low:high], self.order[low:high])

    def where(self, keep: npt.NDArray[np.bool_]) -> "Wave":
        """Some of the changes."""
        return Wave(self.times[keep], self.levels[keep], self.order[keep])

    def tidy(self, before: int) -> "Wave":
        """Without entries that change nothing, when the level was `before`."""
        if not len(self.times):
            return self
        changes = np.empty(len(self.times), np.bool_)
        changes[0] = self.levels[0] != before
        np.not_equal(self.levels[1:], self.levels[:-1], out=changes[1:])
        return self if changes.all() else self.where(changes)


def wave(
    times: "Sequence[Ns] | Int64Array", levels: Sequence[int] | Levels, order: "Sequence[int] | Int64Array"
) -> Wave:
    """A wave from columns that are in order already."""
    return Wave(np.asarray(times, np.int64), np.asarray(levels, np.uint8), np.asarray(order, np.int64))


def merge(*waves: Wave) -> Wave:
    """The changes of all waves, by time, then by place in the recording."""
    filled = [one for one in waves if len(one.times)]
    if len(filled) == 1:
        return filled[0]
    if not filled:
        return wave((), (), ())
    times, levels, order = (np.concatenate(columns) for columns in zip(*filled, strict=True))
    index = np.lexsort((order, times))
    return Wave(times[index], levels[index], order[index])


class Spoken(NamedTuple):
    """A character on a wire: its start bit begins at `begin`, its last stop bit ends at `end`."""

    begin: Ns
    end: Ns
    char: Char
    order: int


def serial_wave(characters: Sequence[Spoken], form: Format) -> Wave:
    """The logic levels of a serial wire.

    1 at rest; start bit 0, data bits from the least significant one on, parity, stop bits 1. A character damaged
    on the line has its parity bit inverted, its stop bits 0. Characters that took no time (a link without line
    timing) leave no trace.
    """
    timed = [spoken for spoken in characters if spoken.begin < spoken.end]
    if not timed:
        return wave((), (), ())
    begin = np.array([spoken.begin for spoken in timed], np.int64)
    end = np.array([spoken.end for spoken in timed], np.int64)
    value = np.array([spoken.char.value for spoken in timed], np.int64)
    framing_ok = np.array([spoken.char.framing_ok for spoken in timed], np.uint8)
    order = np.array([spoken.order for spoken in timed], np.int64)
    levels = np.zeros((len(timed), form.bits + 1), np.uint8)  # one more: the line at rest behind the character
    data = value[:, None] >> np.arange(form.data_bits) & 1
    levels[:, 1 : 1 + form.data_bits] = data
    if form.parity != "none":
        damaged = np.array([not spoken.char.parity_ok for spoken in timed], np.int64)
        levels[:, 1 + form.data_bits] = (data.sum(axis=1) + (form.parity == "odd") + damaged) & 1
    levels[:, form.bits - form.stop_bits : form.bits] = framing_ok[:, None]
    levels[:, form.bits] = 1
    # the k-th bit begins k bit times after the first, rounded once
    bits = np.arange(form.bits + 1)
    times = begin[:, None] + (2 * bits * (end - begin)[:, None] + form.bits) // (2 * form.bits)
    return wave(times.ravel(), levels.ravel(), np.repeat(order, form.bits + 1)).tidy(1)
