"""Cells for tests, written down as their files would be, and what is read from their recordings."""

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.pins import PinSet
from detent.ticks import Ns


def cell(text: str, files: dict[str, str] | None = None, **options: object) -> Cell:
    """The cell that the TOML `text` describes, with the files that it names. Line timing is off unless asked for."""
    contents = files or {}

    def read(name: str) -> str:
        try:
            return contents[name]
        except KeyError:
            raise FileNotFoundError(2, "No such file or directory") from None

    return build(parse(text, "cell.toml"), read, **{"line_timing": False, **options})  # type: ignore[arg-type]


def edges(made: Cell, unit: str, pin: str) -> list[tuple[Ns, int]]:
    """What an output of a unit did."""
    assert made.recording is not None
    return [(item.at, item.level) for item in made.recording.of(unit) if isinstance(item, PinSet) and item.pin == pin]


def pulses(made: Cell, unit: str) -> list[Ns]:
    """The times of all pulses of a unit so far."""
    assert made.recording is not None
    spans = made.recording.motion(unit, made.now)
    return [span.train.time_of(pulse) for span in spans for pulse in range(span.first, span.last + 1)]


def places(made: Cell, unit: str) -> list[tuple[Ns, int]]:
    """The same with where the shaft is after each."""
    assert made.recording is not None
    return [
        (span.train.time_of(pulse), span.shaft + span.direction * pulse)
        for span in made.recording.motion(unit, made.now)
        for pulse in range(span.first, span.last + 1)
    ]
