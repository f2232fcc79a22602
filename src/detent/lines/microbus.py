"""The MICROBUS: eight parallel lines and a strobe for each direction, from one CCU to many drives.

Every drive sees every byte of the CCU, and the CCU every answer. As a stream of bytes it is like any line with
several units; beside the bytes the line drives the strobe /DATA READY, the T0 of every drive. A byte stands on the
bus for its whole time, and the strobe is low in the second half of it: the drives have taken the byte when it
goes high. How long a byte takes is our assumption, and the format's matter. So is that the drives see it when the
program of the CCU lets go of the bus (`LET_GO`): messages have no marks, and half a message must not wait for the next
program's bytes.
"""

from collections import deque

from detent.lines.line import Arrival, Line
from detent.pins import HIGH, LOW, Level
from detent.ticks import Ns, instants
from detent.uart import Char, Chars, Format

LET_GO = Char(0, framing_ok=False)  # the CCU lets go of the bus: no byte, and no strobe


class Microbus(Line):
    """A MICROBUS. Without line timing bytes take no time, and the strobe rests."""

    __slots__ = ("_edges", "_strobed")

    INSTANTS = instants(_strobed=0)
    strobe: str = "T0"
    parting: Chars = (LET_GO,)

    def __init__(self, form: Format, *, timed: bool = True, early: Ns = 0, start_bits: bool = False) -> None:
        self._edges: deque[tuple[Ns, Level]] = deque()  # of the strobe, to come
        self._strobed: Ns = -1  # the begin of the last byte that has its edges
        super().__init__(form, timed=timed, early=early, start_bits=start_bits)

    def advance(self, now: Ns) -> list[Arrival]:
        """Deliver what is due, as every line does."""
        arrived = super().advance(now)
        self._plan()
        return arrived

    def strobes(self, now: Ns) -> list[Level]:
        """The levels that the strobe takes up to and including `now`, in order."""
        due = []
        while self._edges and self._edges[0][0] <= now:
            due.append(self._edges.popleft()[1])
        self._plan()
        return due

    def _plan(self) -> None:
        for sent in self._on_wire:
            if sent.at > self._strobed and sent.done > sent.at and sent.char.framing_ok:
                self._strobed = sent.at
                self._edges += ((sent.at + (sent.done - sent.at) // 2, LOW), (sent.done, HIGH))
        super()._plan()
        if self._edges and self._edges[0][0] < self.deadline:
            self.deadline = self._edges[0][0]
