"""The verb `table`: the table compiler of the SUPERSIGMA drive (the paper's FORTRAN program)."""

import csv
import json as json_text
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from detent.cli.overwrite import Overwrite

if TYPE_CHECKING:
    from detent.ramps.differences import Curve, Differences

PAGE_3 = 0x300  # where MOVP3 of an 8748 reads a table


def table(
    curve: str = "sine",
    *,
    peak: float | None = None,
    angular: float | None = None,
    phase: float | None = None,
    low: float | None = None,
    high: float | None = None,
    duration: str | None = None,
    interval: str = "1.29 ms",
    at: int = PAGE_3,
    bin_: Annotated[Path | None, Parameter(name="--bin")] = None,
    hex_: Annotated[Path | None, Parameter(name="--hex")] = None,
    text: Path | None = None,
    overwrite: Overwrite = False,
    option: bool = False,
    json: bool = False,
) -> None:
    """Compile a curve into the table of differences of a SUPERSIGMA drive.

    Without arguments it is the paper's table.

    For example: `detent table linear --low 800 --high 9000 --duration "300 ms" --hex ramp.hex`

    Parameters
    ----------
    curve
        sine: peak sin^2(angular t + phase), the paper's; linear: from low to high; or a file of lines t,V
        (seconds, half steps/s) with straight lines between them.
    peak
        Peak of the sine, in half steps/s: 15000.
    angular
        Angular rate of the sine, in radians/s: 4.54426.
    phase
        Phase of the sine, in radians: 0.2097.
    low
        Where the linear curve starts, in half steps/s: 650.
    high
        Where the linear curve ends, in half steps/s: 15000.
    duration
        How long the ramp takes: 0.3 s, or up to the last t of a file.
    interval
        Time between two entries, in whole clocks of 500 ns.
    at
        Address of the table in the EPROM, for --hex: by default page 3, where MOVP3 reads.
    bin_
        Write the differences as bytes.
    hex_
        Write them in Intel HEX.
    text
        Write a listing: t, V, N and the difference, entry by entry.
    overwrite
        Write over files that are there.
    option
        Print only the line that the option `table` of the model supersigma takes.
    json
        Print everything as JSON.
    """
    from detent.cli.endings import asked_wrongly, failed
    from detent.outputs.files import check_outputs, write_whole
    from detent.ramps.differences import EPROM, CurveError, compiled
    from detent.ramps.hex_records import intel_hex

    try:
        check_outputs((bin_, hex_, text), [Path(curve)], asked=overwrite)
        clocks = _clocks(interval)
        wanted = {"peak": peak, "angular": angular, "phase": phase, "low": low, "high": high}
        name = curve
        try:
            law, seconds, name = _curve(curve, {key: it for key, it in wanted.items() if it is not None}, duration)
            made = compiled(law, seconds, clocks)
        except CurveError as error:
            raise CurveError(f"{name}: {error}") from None
        if not 0 <= at <= EPROM - len(made.differences):
            raise ValueError(
                f"--at {at}: {len(made.differences)} bytes do not fit there in the {EPROM} of an 8748; "
                f"say 0 to {EPROM - len(made.differences)}, or leave it out for {PAGE_3}"
            )
        records = intel_hex(made.differences, at)
    except (ValueError, OSError) as error:
        asked_wrongly(error)
    listing = _listing(made, law, name)
    try:
        for path, data in ((bin_, made.differences), (hex_, records.encode()), (text, listing.encode())):
            if path is not None:
                write_whole(path, data)
    except OSError as error:
        failed(f"{error.filename}: cannot write it: {error.strerror}")
    if json:
        print(json_text.dumps({"curve": name, "option": str(made), **_facts(made, at)}))
    elif option:
        print(made)
    else:
        print(_summary(made, name, at), end="")
        for path in (bin_, hex_, text):
            if path is not None:
                print(f"Wrote {path}")


def _clocks(interval: str) -> int:
    """The interval in clocks. ValueError if it is none, or no whole number of them."""
    from detent.ramps.rate_generator import CLOCK_NS
    from detent.ticks import parse_duration

    ns = parse_duration(interval)
    if ns < CLOCK_NS or ns % CLOCK_NS:
        raise ValueError(f"--interval: {interval} is no whole number of clocks of {CLOCK_NS} ns")
    return ns // CLOCK_NS


def _curve(curve: str, given: dict[str, float], duration: str | None) -> "tuple[Curve, float, str]":
    """The law, its seconds, and what to call it. ValueError, OSError."""
    from detent.ramps import curves
    from detent.ticks import SECOND, parse_duration

    seconds = None if duration is None else parse_duration(duration) / SECOND
    takes = {"sine": ("peak", "angular", "phase"), "linear": ("low", "high")}.get(curve, ())
    strange = [key for key in given if key not in takes]
    if strange:
        raise ValueError(f"--{strange[0]} is not for the curve {curve}: it takes {', '.join(takes) or 'no numbers'}")
    if curve == "sine":
        numbers = [given.get(key, default) for key, default in zip(takes, curves.PAPER_SINE, strict=True)]
        name = f"{numbers[0]:g} sin^2({numbers[1]:g} t + {numbers[2]:g})"
        return curves.sine_squared(*numbers), curves.PAPER_DURATION if seconds is None else seconds, name
    if curve == "linear":
        start, end = given.get("low", curves.PAPER_LOW), given.get("high", curves.PAPER_HIGH)
        seconds = curves.PAPER_DURATION if seconds is None else seconds
        if not seconds > 0:
            raise ValueError("--duration: a ramp takes some time")
        return curves.linear(start, end, seconds), seconds, f"linear, {start:g} to {end:g}"
    points = _points(Path(curve))
    return curves.through(points), points[-1][0] if seconds is None else seconds, curve


def _points(path: Path) -> list[tuple[float, float]]:
    """The lines t,V of a file; a first line of words is a heading. ValueError with the line, OSError."""
    from detent.controllers.catalogue import unknown
    from detent.realtime.texts import read_text

    if "." not in str(path) and not path.exists():
        raise unknown("curve", str(path), ("sine", "linear", "FILE.csv"))
    points: list[tuple[float, float]] = []
    try:
        lines = list(csv.reader(read_text(path).splitlines()))
    except (OSError, csv.Error) as error:
        raise ValueError(f"{path}: cannot read it: {getattr(error, 'strerror', None) or error}") from None
    for number, row in enumerate(lines, 1):
        if not row or row[0].lstrip().startswith("#"):
            continue
        try:
            t, v = (float(cell) for cell in row)
        except ValueError:
            if number == 1:
                continue
            raise ValueError(f"{path}:{number}: {','.join(row)!r}: write t,V in seconds and half steps/s") from None
        points.append((t, v))
    if not points:
        raise ValueError(f"{path}: there are no points t,V in it")
    return points


def _facts(made: "Differences", at: int) -> dict[str, object]:
    """The table and the memory it takes."""
    from detent.ramps.differences import EPROM, PROGRAM

    counts = made.counts()
    return {
        "first_n": counts[0],
        "last_n": counts[-1],
        "interval_ns": made.interval * 500,
        "differences": list(made.differences),
        "largest": max(made.differences),
        "address": at,
        "bytes": {**PROGRAM, "table of differences": len(made.differences)},
        "bytes_used": made.bytes_of_program,
        "bytes_of_eprom": EPROM,
    }


def _summary(made: "Differences", name: str, at: int) -> str:
    """What was made, the bytes themselves, and the budget of the 8748."""
    from detent.ramps.differences import EPROM, PROGRAM
    from detent.ramps.differences import shown_interval as shown
    from detent.ramps.rate_generator import CLOCK_HZ

    counts, data = made.counts(), made.differences
    lines = [
        f"{name}: {len(data)} differences, one every {shown(made.interval)}",
        f"first N {counts[0]} ({CLOCK_HZ / (counts[0] + 1):.0f} half steps/s), "
        f"last N {counts[-1]} ({CLOCK_HZ / (counts[-1] + 1):.0f} half steps/s), largest difference {max(data)}",
        "",
        *(f"{at + i:03X}  {data[i : i + 16].hex(' ').upper()}" for i in range(0, len(data), 16)),
        "",
    ]
    for section, used in {**PROGRAM, "table of differences": len(data)}.items():
        lines.append(f"{section:22} {used:5}")
    used = made.bytes_of_program
    lines.append(f"{'together':22} {used:5} of the {EPROM} bytes of an 8748, {EPROM - used} left")
    return "\n".join(lines) + "\n"


def _listing(made: "Differences", law: "Curve", name: str) -> str:
    """Entry by entry: t, V of the curve, N, the difference to the next."""
    from detent.ramps.rate_generator import CLOCK_NS

    lines = [f"# {name}", f"# {made}", "# entry  t/ms  V/(half steps/s)  N  difference"]
    counts = made.counts()
    for entry, n in enumerate(counts):
        ms = entry * made.interval * CLOCK_NS / 1e6
        difference = str(made.differences[entry]) if entry < len(made.differences) else ""
        lines.append(f"{entry:5} {ms:9.2f} {law(ms / 1e3):12.2f} {n:6} {difference:>4}".rstrip())
    return "\n".join(lines) + "\n"
