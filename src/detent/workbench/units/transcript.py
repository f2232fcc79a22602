"""What was said at a port between the workbench and a unit, byte by byte in words."""

from typing import Final

from detent.controllers.phrase import Phrases
from detent.ticks import MS, SECOND, Ns
from detent.workbench.talk import LONGEST, MOST_ROWS, Row, Talk, parted, shown

HOST: Final = ""  # the sender of what the workbench says
SILENCE: Final[Ns] = 200 * MS  # what comes later does not belong to what was begun before


class Transcript:
    """Rows as `detent.workbench.talk` has them.

    Times are those at which bytes were handed over or fetched, so a row ends up to a few milliseconds after its last
    stop bit.
    """

    def __init__(self, phrases: Phrases, *, numbers: bool = False) -> None:
        """`numbers`: bytes are shown as hexadecimal numbers, as they are no text."""
        self._phrases = phrases
        self._text = (lambda data: data.hex(" ").upper()) if numbers else shown
        self._rows: list[Row] = []
        self._first = 0
        self._asked = b""  # what the host said last
        self._open: dict[str, int] = {}  # sender: number of the row in the making
        self.looking = False
        """Whether what is said now are the questions of a look (`questions`)."""
        self.questions: set[int] = set()
        """Numbers of the rows of looks, and of what was answered to them."""
        self.count = 0
        """Bytes so far, of both sides."""

    def take(self, sender: str, data: bytes, at: Ns) -> None:
        """`sender` (`HOST`, or another name) said `data` at `at`."""
        self.count += len(data)
        for value in data:
            number = self._open.get(sender)
            if number is not None and (number < self._first or at - self._rows[number - self._first].end > SILENCE):
                self._end(sender)
                number = None
            if number is None:
                number = self._open[sender] = self._first + len(self._rows)
                self._rows.append(Row(number, at, at, sender, b"", (), "", False, False))
                if self.looking:
                    self.questions.add(number)
            row = self._rows[number - self._first]
            said = row.data + bytes((value,))
            whole = self._phrases.whole(said, sender == HOST) or len(said) >= LONGEST
            self._show(row._replace(data=said, end=at, whole=whole))
            if whole:
                del self._open[sender]
        if len(self._rows) > MOST_ROWS:
            excess = len(self._rows) - MOST_ROWS
            del self._rows[:excess]
            self._first += excess
            self.questions = {number for number in self.questions if number >= self._first}

    def since(self, number: int) -> Talk:
        """The rows from `number` on."""
        first = max(number, self._first)
        rows = tuple(self._rows[first - self._first :])
        going_on = min((row.number for row in rows if not row.whole), default=self._first + len(self._rows))
        return Talk(first, rows, going_on, 0)

    def next(self) -> int:
        """The number of the next row."""
        return self._first + len(self._rows)

    def _end(self, sender: str) -> None:
        """Nothing more comes to what `sender` has begun."""
        number = self._open.pop(sender)
        if number >= self._first:
            self._show(self._rows[number - self._first]._replace(whole=True))

    def _show(self, row: Row) -> None:
        if row.sender == HOST:
            self._asked = row.data
        phrase = self._phrases.read(row.data, row.sender == HOST, self._asked)
        parts = parted(phrase, row.data, self._text)
        self._rows[row.number - self._first] = row._replace(parts=parts, note=phrase.note, wrong=phrase.wrong)


def nanoseconds(seconds: float) -> Ns:
    """Seconds of a port's clock as a time."""
    return round(seconds * SECOND)
