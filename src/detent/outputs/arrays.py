"""NumPy archives (NPZ): pulse times, positions and pin levels, for `numpy.load`.

- ``UNIT/step_times`` (int64): ns at which each step pulse begins
- ``UNIT/step_directions`` (int8): +1 or -1
- ``UNIT/positions`` (int64): the commanded position behind each pulse, in steps
- ``UNIT/PIN/times`` (int64), ``UNIT/PIN/levels`` (int8): from that time on the pin is 0, 1, or -1 (no supply)
- ``UNIT/WINDING/times`` (int64), ``UNIT/WINDING/counts`` (int16): from that time on so many of 256 PWM counts
- ``meta`` (str): JSON: units, their pins and positions at 0, the end in ns, and what the caller adds

The first entry of a pin is its level before 0, at time -1. The second axis of a unit is a UNIT of its own, like
`board.Y`; all pins, and all windings, are with the first. A step clock whose pulses no wire carries to another
device has no entry of its own: `step_times` are its pulses, and `meta` tells their width and level. The same
signals give the same bytes.
"""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np
import numpy.typing as npt

from detent.cell.recording import Span
from detent.outputs.files import MARK, open_whole
from detent.outputs.signals import Signals, UnitSignals, Watch, nobody_looks
from detent.outputs.waves import UNKNOWN
from detent.pulses.segment import Int64Array

BLOCK = 1 << 18  # pulses made at a time


def size(signals: Signals) -> int:
    """About how many bytes there are before they are compressed."""
    return sum(unit.motion.pulse_count * (17 + 10 * len(unit.windings)) for unit in signals.units) + sum(
        9 * len(unit.logged(pin).times) for unit in signals.units for pin in unit.pins
    )


def write(path: Path, signals: Signals, meta: Mapping[str, Any] | None = None, watch: Watch = nobody_looks) -> None:
    """Write the file, whole or not at all. `meta` must be fit for JSON; `watch` is told how far it is.

    ValueError for more pulses than can be written; OSError if it cannot be.
    """
    total, done = 3 * signals.pulse_count(), 0
    about = {"until_ns": signals.until, "units": {unit.name: _about(unit) for unit in signals.units}, **(meta or {})}
    text = np.array(json.dumps(about, sort_keys=True))
    with open_whole(path) as file, ZipFile(file, "w", ZIP_DEFLATED) as archive:
        archive.comment = MARK
        _put(archive, "meta", text.dtype, (), [text])
        for unit in signals.units:
            _put_unit(archive, unit, lambda pulses, before=done: watch(before + pulses, total))  # type: ignore[misc]
            _put_windings(archive, unit, signals)
            done += 3 * unit.motion.pulse_count


def _about(unit: UnitSignals) -> dict[str, Any]:
    output = unit.view.pulse_output
    return {
        "pins": list(unit.pins),
        "windings": list(unit.windings),
        "position_at_0": unit.motion.start,
        "pulse_output": None
        if output is None
        else {
            "pins": {f"{way:+d}": pin for way, pin in output.pins.items()},
            **({"common": output.common} if output.common else {}),
            "width_ns": output.width,
            "active": output.active,
        },
    }


def _put_unit(archive: ZipFile, unit: UnitSignals, told: Callable[[int], None]) -> None:
    """The arrays of a unit; `told` how many pulses are in them so far, each counted in the three that it is in."""
    name, count, int64 = unit.name, (unit.motion.pulse_count,), np.dtype(np.int64)
    done = 0

    def blocks() -> Iterator[tuple[Span, int, int]]:
        nonlocal done
        for span, first, last in _blocks(unit.motion.spans):
            yield span, first, last
            done += last - first + 1
            told(done)

    _put(archive, f"{name}/step_times", int64, count, (span.train.times(a, b) for span, a, b in blocks()))
    signs = (np.full(b - a + 1, span.direction, np.int8) for span, a, b in blocks())
    _put(archive, f"{name}/step_directions", np.dtype(np.int8), count, signs)
    places = (span.shaft + span.direction * np.arange(a, b + 1, dtype=np.int64) for span, a, b in blocks())
    _put(archive, f"{name}/positions", int64, count, places)
    for pin in unit.pins:
        if pin not in unit.unlogged and pin not in unit.windings:
            wave = unit.wave(pin)
            times = np.concatenate((np.array([-1], np.int64), wave.times))
            levels = np.concatenate(([unit.level_before(pin, 0)], wave.levels)).astype(np.int8)
            levels[levels == UNKNOWN] = -1
            _put(archive, f"{name}/{pin}/times", times.dtype, times.shape, [times])
            _put(archive, f"{name}/{pin}/levels", levels.dtype, levels.shape, [levels])


def _put_windings(archive: ZipFile, unit: UnitSignals, signals: Signals) -> None:
    found: dict[str, list[tuple[Int64Array, Int64Array]]] = {pin: [] for pin in unit.windings}
    for begin, end in signals.windows() if found else ():
        for pin, driven in unit.windings.items():
            found[pin].append(driven.wave(pin, begin, end))
    for pin, pieces in found.items():
        times = np.concatenate([np.array([-1], np.int64), *(times for times, _ in pieces)])
        counts = np.concatenate([np.zeros(1, np.int64), *(counts for _, counts in pieces)]).astype(np.int16)
        _put(archive, f"{unit.name}/{pin}/times", times.dtype, times.shape, [times])
        _put(archive, f"{unit.name}/{pin}/counts", counts.dtype, counts.shape, [counts])


def _blocks(spans: Iterable[Span]) -> Iterator[tuple[Span, int, int]]:
    """Each span with the first and last number of some of its pulses, in order."""
    for span in spans:
        for first in range(span.first, span.last + 1, BLOCK):
            yield span, first, min(first + BLOCK - 1, span.last)


def _put(
    archive: ZipFile, key: str, dtype: np.dtype[Any], shape: tuple[int, ...], parts: Iterable[npt.NDArray[Any]]
) -> None:
    """Add one array in pieces, as `numpy.savez_compressed` would, but always with the same date."""
    member = ZipInfo(f"{key}.npy", (1980, 1, 1, 0, 0, 0))
    member.compress_type = ZIP_DEFLATED
    with archive.open(member, "w", force_zip64=True) as file:
        _put_header(file, dtype, shape)
        for part in parts:
            file.write(part.tobytes())


def _put_header(file: IO[bytes], dtype: np.dtype[Any], shape: tuple[int, ...]) -> None:
    header = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, header)
