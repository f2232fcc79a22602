"""What the hosts of a cell said, and what they heard: command lines, their answers, and which of them were refused.

Answers have no numbers. What is heard belongs to the last line that was whole by then, or had begun, where units echo.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.cell import Cell
from detent.cell.recording import Entry, Recording, Repeated
from detent.controllers import catalogue
from detent.controllers.device import Cautioned, Controller, Refused
from detent.ticks import Ns

MOST_HEARD = 1 << 20  # characters kept of what came back for one line
MOST_REFUSED = 10_000


@dataclass
class Exchange:
    """A command line to a unit, and what its host heard then."""

    at: Ns
    unit: str
    sent: str
    scripted: bool
    line: int
    begins: Ns
    ends: Ns | None = None  # None: it is the last on its line, and still being sent for all that is known
    heard: bytearray = field(default_factory=bytearray)
    refused: list[Refused] = field(default_factory=list)


class Observer(Recording):
    """A recording that knows what was refused, and which axes are in motion; it keeps the rest if it is told to."""

    __slots__ = ("_conversation", "_keeps", "moving")

    def __init__(self, cell: Cell, conversation: "Conversation", *, keeps: bool) -> None:
        """It goes on from what the cell has recorded so far."""
        super().__init__(cell.wiring.names[: cell.wiring.units])
        self._conversation, self._keeps = conversation, keeps
        self.moving: dict[tuple[int, str], None] = {}  # units and their axes
        for unit, entry in cell.recording or ():
            self.extend(unit, (entry,))

    def extend(self, unit: int, entries: Sequence[Entry]) -> None:
        """Note what one unit did."""
        if self._keeps:
            super().extend(unit, entries)
        for entry in entries:
            kind = type(entry)
            if kind is MotionStarted:
                self.moving[unit, entry.axis] = None  # type: ignore[union-attr]
            elif kind is MotionEnded or kind is MotionCut:
                self.moving.pop((unit, entry.axis), None)  # type: ignore[union-attr]
            elif kind is Refused:
                self._conversation.note_refusal(unit, entry)  # type: ignore[arg-type]
            elif kind is Cautioned:
                self._conversation.note_caution(unit, entry)  # type: ignore[arg-type]

    def turn(self, turns: Repeated) -> None:
        """Programs turned in loops, or the cell in rounds: nothing moves that did not before, nothing was refused."""
        if self._keeps:
            super().turn(turns)


class Conversation:
    """Of the cell that is built with `typed`, from `attend` on."""

    def __init__(self) -> None:
        self.exchanges: list[Exchange] = []
        self.refused: list[tuple[str, Refused, Exchange | None]] = []  # the unit, and the line that it belongs to
        self.unasked: dict[int, bytearray] = {}  # by line: what was heard before anybody had said anything there
        self.cautions: list[tuple[str, Cautioned]] = []  # the unit, and what it does that may not be expected
        self.scripted = True  # whether what is typed now comes from the cell's script
        self._cell: Cell | None = None
        self._of_line: dict[int, list[Exchange]] = {}  # those that may still be answered

    def attend(self, cell: Cell, *, keeps: bool) -> Observer:
        """Listen to this cell from now on, in the place of its recording, which goes on if it `keeps` everything."""
        observer = Observer(cell, self, keeps=keeps)
        cell.recording, self._cell = observer, cell
        return observer

    def typed(self, unit: str, text: str) -> None:
        """The host of a unit is about to send it a line: give it to `build`."""
        self.listen()
        cell = self._cell
        assert cell is not None
        number = cell.wiring.line_of[cell.unit(unit)]
        self._close(number)
        begins = max(cell.now, cell.lines[number].host_busy_until)
        exchange = Exchange(cell.now, unit, text, self.scripted, number, begins)
        self.exchanges.append(exchange)
        self._of_line.setdefault(number, []).append(exchange)

    def listen(self) -> None:
        """Take what the hosts have heard by now."""
        cell = self._cell
        if cell is None:
            return
        for number, line in enumerate(cell.lines):
            if line.hosted or not line.heard:
                continue
            open_ones = self._of_line.get(number)
            if open_ones is None:
                kept = self.unasked.setdefault(number, bytearray())
                kept += bytes(heard.char.value & 0xFF for heard in line.take())[: MOST_HEARD - len(kept)]
                continue
            self._close(number)
            for heard in line.take():
                while len(open_ones) > 1 and self._turn(open_ones[1]) <= heard.at:
                    del open_ones[0]
                if len(open_ones[0].heard) < MOST_HEARD:
                    open_ones[0].heard.append(heard.char.value & 0xFF)

    def answers(self, exchange: Exchange) -> list[str]:
        """What the host reads in what it has heard."""
        assert self._cell is not None
        return self._cell.serial_unit(exchange.unit).answers(bytes(exchange.heard))

    def said(self) -> dict[str, list[str]]:
        """What units said unasked, by unit: of those that hold programs, which may speak; others only sign on."""
        found: dict[str, list[str]] = {}
        for number, heard in self.unasked.items():
            assert self._cell is not None
            unit = self._cell.wiring.names[self._cell.wiring.lines[number][0][0]]
            part = self._cell.controllers().get(unit)
            if part is not None and catalogue.model(part.model).language is not None and part.answers(bytes(heard)):
                found[unit] = part.answers(bytes(heard))
        return found

    def note_refusal(self, unit: int, refused: Refused) -> None:
        """A unit turns a line down."""
        cell = self._cell
        if cell is None or len(self.refused) >= MOST_REFUSED:
            return
        number, found = cell.wiring.line_of[unit], None
        self._close(number)
        for exchange in reversed(self._of_line.get(number, ())):
            if self._whole(exchange) <= refused.at:
                found = exchange
                break
        self.refused.append((cell.wiring.names[unit], refused, found))
        if found is not None:
            found.refused.append(refused)

    def note_caution(self, unit: int, caution: Cautioned) -> None:
        """A unit obeys a line in a way that may not be expected."""
        if self._cell is not None and len(self.cautions) < MOST_REFUSED:
            self.cautions.append((self._cell.wiring.names[unit], caution))

    def _close(self, number: int) -> None:
        """The last line that was sent there: when it is over, as long as no other follows it."""
        for exchange in self._of_line.get(number, ())[-1:]:
            if exchange.ends is None:
                assert self._cell is not None
                exchange.ends = max(self._cell.lines[number].host_busy_until, exchange.begins)

    def _turn(self, exchange: Exchange) -> Ns:
        """From when on what is heard belongs to this line and not to the one before it."""
        assert self._cell is not None
        part = self._cell.parts[self._cell.unit(exchange.unit)]
        echoes = not hasattr(part, "status") or catalogue.model(_model(part)).echoes  # an adapter passes echoes on
        return exchange.begins if echoes else self._whole(exchange)

    def _whole(self, exchange: Exchange) -> Ns:
        """When the units have it: within its last character, as some do not wait for the end of it."""
        assert self._cell is not None
        ends = exchange.begins if exchange.ends is None else exchange.ends
        character = self._cell.lines[exchange.line].format.duration(1)
        return ends - character // 2 if ends > exchange.begins else ends


def _model(part: object) -> str:
    controller: Controller = part  # type: ignore[assignment]
    return controller.model
