"""The files that `run` writes: what stands in their way, how large they will be, and how far they are."""

import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from errno import ENOSPC
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

if TYPE_CHECKING:
    from detent.cell.cell import Cell
    from detent.outputs.signals import Signals, Watch
    from detent.realtime.cell_source import CellSource
    from detent.ticks import Ns

FASTEST = 1_000_000_000  # samples a second
LARGE = 20_000_000  # bytes; larger is told before it is begun


class ExportFiles(NamedTuple):
    """The files to write, None for one that is not asked for.

    `sr_rate` are the samples a second of a sigrok session, `frequency` and `error` those of the clock of step files.
    """

    plot: Path | None = None
    vcd: Path | None = None
    sr: Path | None = None
    npz: Path | None = None
    steps: Path | None = None
    sr_rate: int | None = None
    frequency: int = 12_000_000
    error: str = "1us"

    @property
    def paths(self) -> list[Path]:
        """Those that are asked for."""
        return [path for path in (self.plot, self.vcd, self.sr, self.npz, self.steps) if path is not None]

    def check(self, inputs: Sequence[Path], *, overwrite: bool) -> None:
        """ValueError for files that cannot be written so, before anything is run."""
        from detent.outputs.files import check_outputs

        if self.plot is not None:
            from detent.outputs.figures import check

            check(self.plot)
        if self.sr_rate is not None and (self.sr is None or not 1 <= self.sr_rate <= FASTEST):
            what = f"--sr-rate is for --sr, in samples a second, 1 to {FASTEST}"
            raise ValueError(f"{what} (times are whole ns), not {self.sr_rate}")
        if self.frequency < 1:
            what = "a clock has 1 tick a second or more, like 12000000"
            raise ValueError(f"--steps-frequency {self.frequency}: {what}")
        check_outputs(self.paths, inputs, asked=overwrite)


def write(cell: "Cell", source: "CellSource", files: ExportFiles) -> None:
    """Write the files that are asked for. Raises ValueError for a wrong choice, OSError, MotorError."""
    if not files.paths:
        return
    from detent.outputs import signals

    described = source.description
    seen = signals.of_cell(cell, {name: unit.shaft for name, unit in described.units.items()})
    rate = files.sr_rate
    if files.vcd is not None or files.npz is not None or files.steps is not None:
        seen.pulse_count()  # nothing is written where one of the files cannot be
    if files.sr is not None:
        from detent.outputs import sigrok

        rate = rate or sigrok.SAMPLERATE
        sigrok.size(seen, rate)
    if files.vcd is not None:
        from detent.outputs import vcd

        with _told(files.vcd, vcd.size(seen), seen) as watch:
            vcd.write(files.vcd, seen, watch)
    if files.sr is not None and rate is not None:
        with _told(files.sr, sigrok.size(seen, rate), seen, compressed=True) as watch:
            sigrok.write(files.sr, seen, samplerate=rate, watch=watch)
    if files.npz is not None:
        from detent.outputs import arrays

        with _told(files.npz, arrays.size(seen), seen, compressed=True) as watch:
            arrays.write(files.npz, seen, watch=watch)
    if files.steps is not None:
        from detent.outputs import step_file
        from detent.ticks import parse_duration

        error: Literal["exact"] | Ns = "exact" if files.error == "exact" else parse_duration(files.error)
        try:
            step_file.write(files.steps, seen, files.frequency, error)
        except ValueError as problem:
            raise ValueError(f"--steps-frequency {files.frequency}: {problem}; take a faster clock") from None
    if files.plot is not None:
        from detent.outputs import figures, rotors

        title = described.title or source.name
        figures.write(files.plot, seen, title=title, rotors=rotors.of_cell(cell))


@contextmanager
def _told(path: Path, size: int, signals: "Signals", *, compressed: bool = False) -> "Iterator[Watch]":
    """Say beforehand how large a large file will be, and then how far it is. OSError if there is no room for it."""
    from detent.cli.unit import progress
    from detent.hosts.exchange import Progress

    if size > LARGE:
        pulses = sum(unit.motion.pulse_count for unit in signals.units)
        what = f"about {show_size(size)}" + (" before it is compressed" if compressed else "")
        print(f"Writing {path}: {pulses} pulses, {what}; Ctrl-C leaves no part of it", file=sys.stderr, flush=True)
        folder = path.resolve().parent
        room = shutil.disk_usage(folder).free if folder.is_dir() else size
        if room < size and not compressed:
            raise OSError(ENOSPC, f"it takes {what}, there is room for {show_size(room)}; run for less", str(path))
    with progress(f"Writing {path.name}") as bar:

        def watch(done: int, total: int) -> None:
            bar(Progress(done, total))

        yield watch


def show_size(size: int) -> str:
    """Bytes for people."""
    for unit in ("bytes", "kB", "MB", "GB", "TB"):
        if size < 1000 or unit == "TB":
            break
        size //= 1000
    return f"{size} {unit}"
