"""Session files of sigrok (`.sr`): what PulseView and sigrok-cli read, with all their decoders.

A sample holds the levels of all channels at one instant. A level that lasts less than the time between two
samples is stretched to one sample, and what follows at once is then late by as much: no edge is lost. An
output without supply is 0.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np

from detent.outputs.files import MARK, open_whole
from detent.outputs.signals import Signals, UnitSignals, Watch, nobody_looks
from detent.outputs.waves import Levels
from detent.pulses.segment import Int64Array
from detent.ticks import SECOND, Ns

SAMPLERATE = 1_000_000  # a step pulse of 1.7 us takes two samples
CHUNK = 1 << 19  # most samples in one member of the archive
WINDOW = 1 << 18  # most pulses of a unit in one member, so that they fit memory
MOST_BYTES = 1 << 33  # of samples before they are compressed: a minute or two of work, and who opens it holds them all
MOST_LATE = 64  # samples by which an edge may be stretched away from its time


class Channel(NamedTuple):
    """One pin of one unit."""

    unit: UnitSignals
    pin: str

    @property
    def name(self) -> str:
        """The name sigrok shows: UNIT.PIN."""
        return f"{self.unit.name}.{self.pin}"


def channels(signals: Signals, names: Sequence[str] | None = None) -> list[Channel]:
    """The channels `names` (UNIT.PIN), in that order; None: every pin drawn. KeyError for a name that is none.

    The winding ends of a driver on the board are pins, too: 1 with current.
    """
    wires = ((unit, pin) for unit in signals.units for pin in dict.fromkeys((*unit.pins, *unit.windings)))
    every = {one.name: one for one in (Channel(unit, pin) for unit, pin in wires)}
    if names is None:
        return list(every.values())
    for name in names:
        if name not in every:
            raise KeyError(f"no channel {name!r}: there are {', '.join(every)}")
    return [every[name] for name in names]


def size(signals: Signals, samplerate: int = SAMPLERATE) -> int:
    """How many bytes the samples have before they are compressed. ValueError for more than can be written."""
    chosen = channels(signals)
    return _samples(signals, samplerate, chosen) * _unitsize(chosen)


def write(
    path: Path, signals: Signals, *, samplerate: int = SAMPLERATE, names: Sequence[str] | None = None,
    watch: Watch = nobody_looks,
) -> None:  # fmt: skip
    """Write the file, whole or not at all.

    `samplerate` is in samples a second, `names` chooses channels, `watch` is told how far it is. ValueError for a
    samplerate that is too low for the edges of a channel, or too high for a run of this length; OSError if the file
    cannot be written.
    """
    chosen = channels(signals, names)
    samples = _samples(signals, samplerate, chosen)
    with open_whole(path) as file, ZipFile(file, "w", ZIP_DEFLATED) as archive:
        archive.comment = MARK
        _put(archive, "version", b"2")
        _put(archive, "metadata", _metadata(chosen, samplerate))
        done = 0
        for number, chunk in enumerate(_chunks(signals, chosen, samplerate, samples), 1):
            _put(archive, f"logic-1-{number}", chunk)
            done += len(chunk) // _unitsize(chosen)
            watch(done, samples)


def _samples(signals: Signals, samplerate: int, chosen: Sequence[Channel]) -> int:
    if not 1 <= samplerate <= SECOND:
        what = f"at least 1 sample a second, and at most {SECOND}, as times are whole ns"
        raise ValueError(f"a samplerate is {what}, not {samplerate}")
    samples, most = signals.until * samplerate // SECOND + 1, MOST_BYTES // _unitsize(chosen)
    if samples > most:
        fits = (most - 1) * SECOND // signals.until
        slower = f"take a samplerate of at most {fits}, a" if fits else "take a"
        raise ValueError(
            f"{signals.until / SECOND:g} s at {samplerate} samples/s are {samples} samples, more than {most}: "
            f"{slower} shorter run, or a VCD, which has no samplerate"
        )
    return samples


def _put(archive: ZipFile, name: str, data: bytes) -> None:
    member = ZipInfo(name, (1980, 1, 1, 0, 0, 0))  # always this date: the same run gives the same file
    member.compress_type = ZIP_DEFLATED
    archive.writestr(member, data, compresslevel=1)


def _metadata(chosen: Sequence[Channel], samplerate: int) -> bytes:
    lines = [
        "[global]", "sigrok version=0.5.2", "", "[device 1]", "capturefile=logic-1", f"total probes={len(chosen)}",
        f"samplerate={samplerate} Hz", "total analog=0",
        *(f"probe{number}={channel.name}" for number, channel in enumerate(chosen, 1)),
        f"unitsize={_unitsize(chosen)}", "",
    ]  # fmt: skip
    return "\n".join(lines).encode()


def _unitsize(chosen: Sequence[Channel]) -> int:
    return max(-(-len(chosen) // 8), 1)


def _chunks(signals: Signals, chosen: Sequence[Channel], samplerate: int, samples: int) -> Iterator[bytes]:
    """The samples of all channels, a chunk at a time."""
    samplers = [_Sampler(channel, samplerate) for channel in chosen]
    for first, count in _members(signals, samplerate, samples):
        steady = np.zeros((1, _unitsize(chosen)), np.uint8)  # what does not change in this chunk
        changing: list[tuple[int, Levels]] = []
        for number, sampler in enumerate(samplers):
            levels = sampler.levels(first, count)
            if len(levels) > 1:
                changing.append((number, levels))
            else:
                steady[0, number // 8] |= levels[0] << (number % 8)
        if not changing:
            yield steady.tobytes() * count
            continue
        rows = np.repeat(steady, count, axis=0)
        for number, levels in changing:
            rows[:, number // 8] |= levels << (number % 8)
        yield rows.tobytes()


def _members(signals: Signals, samplerate: int, samples: int) -> Iterator[tuple[int, int]]:
    """First sample and number of samples of each member: few enough, with few enough pulses."""
    first = 0
    for _, end in signals.windows(WINDOW):
        behind = min(-(-end * samplerate // SECOND), samples)  # the first sample that shows nothing of this window only
        while first < behind:
            count = min(CHUNK, behind - first)
            yield first, count
            first += count
    if first < samples:
        yield first, samples - first


class _Sampler:
    """One channel, sampled from the beginning on, chunk after chunk."""

    def __init__(self, channel: Channel, samplerate: int) -> None:
        self._unit, self._channel, self._samplerate = channel.unit, channel, samplerate
        self._level = channel.unit.level_before(channel.pin, 0)
        self._free = 0  # the earliest sample at which the next edge can be shown
        self._late: tuple[Int64Array, Levels] = (np.empty(0, np.int64), np.empty(0, np.uint8))  # for the next chunk

    def levels(self, first: int, count: int) -> Levels:
        """The levels of the samples first .. first + count - 1; a single one if that does not change."""
        rate = self._samplerate
        fresh = self._unit.wave(self._channel.pin, _first_ns(first, rate), _first_ns(first + count, rate))
        at = np.concatenate((self._late[0], self._edges(fresh.times)))
        to = np.concatenate((self._late[1], fresh.levels))
        inside = int(np.searchsorted(at, first + count))
        self._late = at[inside:], to[inside:]
        at, to = at[:inside], to[:inside]
        before = self._level
        if not inside:
            return np.array([before == 1], np.uint8)
        self._level = int(to[-1])
        lengths = np.diff(at, prepend=first, append=first + count)
        return np.repeat(np.concatenate(([before], to)) == 1, lengths).view(np.uint8)

    def _edges(self, times: Int64Array) -> Int64Array:
        """The sample of each change: the first one at or after it, and behind that of the change before."""
        if not len(times):
            return times
        seconds, rest = np.divmod(times, SECOND)
        wanted = seconds * self._samplerate - (-rest * self._samplerate // SECOND)
        index = np.arange(len(wanted))
        at = np.maximum(np.maximum.accumulate(wanted - index), self._free) + index
        self._free = int(at[-1]) + 1
        late = at - wanted
        if late.max() > MOST_LATE:
            raise self._too_slow(times)
        return at

    def _too_slow(self, times: Int64Array) -> ValueError:
        run = min(MOST_LATE, len(times) - 1)
        shortest = max(int((times[run:] - times[:-run]).min()), 1) if run else 1
        needed = max(-(-run * SECOND // shortest), self._samplerate + 1)
        return ValueError(
            f"{self._samplerate} samples/s are too few for the edges of {self._channel.name}: take at least {needed}, "
            "leave the channel out, or write a VCD, which has no samplerate"
        )


def _first_ns(sample: int, samplerate: int) -> Ns:
    """The first ns that is shown by this sample and not by the one before it."""
    return (sample - 1) * SECOND // samplerate + 1
