"""What was said on a serial line, by whom, and what every byte of it was."""

from collections.abc import Callable
from itertools import groupby
from typing import Final, NamedTuple

from detent.cell.recording import Received
from detent.controllers import catalogue
from detent.controllers.phrase import Lines, Phrase, Phrases
from detent.controllers.supersigma import link
from detent.ticks import MS, Ns
from detent.workbench.messages import LinePicture, Picture
from detent.workbench.mirror import Mirror

SILENCE: Final[Ns] = 200 * MS  # what comes later does not belong to a frame that was begun before
BUS_SILENCE: Final[Ns] = link.SILENCE  # nor, on a MICROBUS, for its drives
MOST_ROWS: Final = 5_000  # of a line
LONGEST: Final = 80  # bytes of a row
_CONTROLS: Final = [
    "NUL", "SOH", "STX", "ETX", "EOT", "ENQ", "ACK", "BEL", "BS", "TAB", "LF", "VT", "FF", "CR", "SO", "SI", "DLE",
    "DC1", "DC2", "DC3", "DC4", "NAK", "SYN", "ETB", "CAN", "EM", "SUB", "ESC", "FS", "GS", "RS", "US",
]  # fmt: skip
_NAMES: Final = dict(enumerate(_CONTROLS)) | {0x7F: "DEL"}


class Part(NamedTuple):
    """Some bytes of a row that belong together."""

    data: bytes
    kind: str  # address, command, argument, checksum, end, answer, echo, error, unknown
    text: str  # as it is shown: printable, control characters by name
    meaning: str  # in words


class Row(NamedTuple):
    """A frame, or what has come of it so far."""

    number: int
    begin: Ns  # of its first start bit
    end: Ns  # of its last stop bit
    sender: str  # the unit; "" for the host outside
    data: bytes
    parts: tuple[Part, ...]
    note: str  # what the whole of it says, in words
    wrong: bool  # an error, or a refusal
    whole: bool  # nothing more will come to it


class Talk(NamedTuple):
    """Rows of a line, in order. Draw `rows` in place of those from `first` on, and ask from `next` on again."""

    first: int
    rows: tuple[Row, ...]
    next: int  # the first row that is not whole, or that is still to come
    cut: int  # how often the past was changed: with another number than before, ask from 0


class _Open:
    """A row in the making."""

    def __init__(self, number: int, sender: str, begin: Ns) -> None:
        self.number, self.sender, self.begin, self.end = number, sender, begin, begin
        self.data = bytearray()
        self.damaged = False


class _Line:
    """The rows of one line."""

    def __init__(self, picture: Picture, line: LinePicture, mirror: Mirror) -> None:
        names = [view.name for view in mirror.views]
        self._units = {names.index(unit): unit for unit in line.units}
        self._heard_by = names.index(line.units[0])  # whatever the host says, the first unit hears it too
        self._host = line.host or ""
        self._ports = {k: mirror.views[k].port for k in self._units}
        self._model = catalogue.MODELS.get(picture.units[line.units[0]].model)
        self._unit = mirror.by_name[line.units[0]]
        self._bus = line.kind == "microbus"
        self._silence = BUS_SILENCE if self._bus else SILENCE
        self._text = shown if not self._bus else lambda data: data.hex(" ").upper()
        self._phrases: Phrases = Lines()
        self.rows: list[Row] = []
        self.first = 0  # the number of the first of them
        self._open: dict[str, _Open] = {}
        self._asked = b""  # what the host said last
        self._seen = 0

    def update(self, mirror: Mirror, now: Ns) -> None:
        """Take what was said since the last call."""
        said, gone = mirror.said, mirror.said_gone
        for unit, entry in said[max(self._seen - gone, 0) :]:
            if isinstance(entry, Received):
                if self._bus and not entry.char.framing_ok:  # the CCU lets go: the drives forget half a message
                    if self._host in self._open:
                        self._close(self._host)
                elif unit == self._heard_by and entry.port == self._ports[unit].receives:
                    self._take(self._host, entry.began, entry.at, entry.char.value, not all(entry.char[1:]))
            elif unit in self._units and entry.port == self._ports[unit].sends:
                self._take(self._units[unit], entry.at, entry.done, entry.char.value, not all(entry.char[1:]))
        self._seen = gone + len(said)
        for sender, row in list(self._open.items()):
            if row.end + self._silence < now:
                self._close(sender)
        if len(self.rows) > MOST_ROWS:
            excess = len(self.rows) - MOST_ROWS
            del self.rows[:excess]
            self.first += excess

    def next(self) -> int:
        """The first row that is not whole, or that is still to come."""
        return min((row.number for row in self._open.values()), default=self.first + len(self.rows))

    def _take(self, sender: str, begin: Ns, end: Ns, value: int, damaged: bool) -> None:
        row = self._open.get(sender)
        if row is not None and begin - row.end > self._silence:
            self._close(sender)
            row = None
        if row is None:
            if self._model is not None and not self._open:
                self._phrases = self._model.phrases(self._unit.straps(begin))
            row = self._open[sender] = _Open(self.first + len(self.rows), sender, begin)
            self.rows.append(self._row(row, False))
        row.data.append(value & 0xFF)
        row.end, row.damaged = end, row.damaged or damaged
        if self._phrases.whole(bytes(row.data), sender == self._host) or len(row.data) >= LONGEST:
            self._close(sender)
        else:
            self._show(row, False)

    def _close(self, sender: str) -> None:
        self._show(self._open.pop(sender), True)

    def _show(self, row: _Open, whole: bool) -> None:
        if row.number >= self.first:
            self.rows[row.number - self.first] = self._row(row, whole)

    def _row(self, row: _Open, whole: bool) -> Row:
        data = bytes(row.data)
        if not data:
            return Row(row.number, row.begin, row.end, row.sender, data, (), "", False, whole)
        if row.sender == self._host:
            self._asked = data
        phrase = self._phrases.read(data, row.sender == self._host, self._asked)
        parts = parted(phrase, data, self._text)
        note = f"damaged on the line; {phrase.note}" if row.damaged else phrase.note
        return Row(row.number, row.begin, row.end, row.sender, data, parts, note, phrase.wrong or row.damaged, whole)


class Talks:
    """What was said on all lines."""

    def __init__(self, picture: Picture, mirror: Mirror) -> None:
        self._picture, self._mirror = picture, mirror
        self._lines: dict[str, _Line] = {}
        self._cuts = mirror.cuts

    def of(self, line: str, since: int) -> Talk:
        """See `Bench.terminal`."""
        mirror = self._mirror
        if self._cuts != mirror.cuts:
            self._cuts = mirror.cuts
            self._lines.clear()
        found = self._lines.get(line)
        if found is None:
            found = self._lines[line] = _Line(self._picture, self._picture.lines[line], mirror)
        found.update(mirror, mirror.until)
        first = max(since, found.first)
        return Talk(first, tuple(found.rows[first - found.first :]), found.next(), mirror.cuts)


def parted(phrase: Phrase, data: bytes, text: Callable[[bytes], str]) -> tuple[Part, ...]:
    """The bytes of a row as `phrase` divides them, each part written by `text`."""
    parts, at = [], 0
    for length, kind, meaning in phrase.pieces:
        parts.append(Part(data[at : at + length], kind, text(data[at : at + length]), meaning))
        at += length
    if data[at:]:
        parts.append(Part(data[at:], "unknown", text(data[at:]), ""))
    return tuple(parts)


def _printed(text: str) -> str:
    """Blanks alone are a key that was pressed, and are to be seen."""
    return text if text.strip() else " ".join(["SPACE"] * len(text))


def shown(data: bytes) -> str:
    """Bytes as they are shown: printable ones as they are, control characters by name, others in hex."""
    runs = groupby(data, key=lambda value: 0x20 <= value < 0x7F)
    return " ".join(
        _printed(bytes(run).decode()) if printable else " ".join(_NAMES.get(value, f"{value:02X}h") for value in run)
        for printable, run in runs
    )
