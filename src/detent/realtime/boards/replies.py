"""What hosts hear, held back until nothing can change it; and non-volatile memory, written when it is certain.

A stop in the firmware takes the cell back to where it happened, a lead and some milliseconds ago. What the cell said or
stored since then is said and stored again, or not at all. So both wait that long.
"""

from collections import deque
from collections.abc import Callable, Sequence
from typing import NamedTuple

from detent.cell.cell import Cell
from detent.cell.outside import Store
from detent.lines.line import Heard
from detent.ticks import NEVER, Ns


class HeldLine:
    """A line as its host sees it through `Replies`."""

    def __init__(self, cell: Cell, number: int, horizon: Callable[[], Ns]) -> None:
        self._cell, self._number, self._horizon = cell, number, horizon
        self._held: deque[Heard] = deque()
        self._given: deque[Heard] = deque(maxlen=4096)  # the newest
        self.count = 0  # characters that the cell has said, given or not

    @property
    def host_busy_until(self) -> Ns:
        """When everything the host has sent is over."""
        return self._cell.lines[self._number].host_busy_until

    @property
    def first(self) -> Ns:
        """When the cell said the first character that is held."""
        return self._held[0].at if self._held else NEVER

    def absorb(self) -> None:
        """Take over what the cell has said."""
        heard = self._cell.lines[self._number].take()
        self._held += heard
        self.count += len(heard)

    def take(self) -> list[Heard]:
        """What is certain by now, and has not been given."""
        if not self._held:
            return []
        horizon, certain = self._horizon(), []
        while self._held and self._held[0].at <= horizon:
            certain.append(self._held.popleft())
        self._given += certain
        return certain

    def rewind(self, count: int, new: Sequence[Heard]) -> list[tuple[Heard, Heard | None]]:
        """After its first `count` characters the cell said `new` instead; what was given already and is not so.

        Pairs of what the host has heard and what it should have. It hears nothing in place of that.
        """
        given = self.count - len(self._held)
        escaped = given - count  # characters that have left, though they are taken back
        wrong: list[tuple[Heard, Heard | None]] = []
        if escaped > 0:
            old = list(self._given)[-escaped:]
            for place, heard in enumerate(old):
                other = new[place] if place < len(new) else None
                if other is None or other.char != heard.char:
                    wrong.append((heard, other))
            self._held = deque(new[escaped:])
            self.count = given + len(self._held)
        else:
            kept = count - given
            self._held = deque([*list(self._held)[:kept], *new])
            self.count = count + len(new)
        return wrong


class _Write(NamedTuple):
    number: int
    at: Ns
    unit: str
    image: bytes


class HeldStores:
    """Give `save` to `build` as its store: what is written while `holding` waits for `flush`; nothing is written twice.

    A write that waits is answered as if it had succeeded. `failed` is called with the unit if it then does not.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self.now: Callable[[], Ns] = lambda: 0
        self.holding: Callable[[], bool] = lambda: False
        self.failed: Callable[[str], None] = lambda unit: None
        self.count = 0  # of writes up to where the cell stands
        self._answers: list[bool] = []
        self._first = 0
        self._waiting: deque[_Write] = deque()

    def save(self, unit: str, image: bytes) -> bool:
        """Write the image of a unit, soon; or answer as when it was written."""
        place, self.count = self.count - self._first, self.count + 1
        if place < len(self._answers):
            return self._answers[place]
        ok = True
        if self.holding() or self._waiting:
            self._waiting.append(_Write(self.count - 1, self.now(), unit, image))
        else:
            ok = self._store(unit, image)
        self._answers.append(ok)
        return ok

    @property
    def first(self) -> Ns:
        """When the first write that waits was made."""
        return self._waiting[0].at if self._waiting else NEVER

    def flush(self, horizon: Ns) -> None:
        """Write what was stored up to `horizon`."""
        while self._waiting and self._waiting[0].at <= horizon:
            write = self._waiting.popleft()
            if not self._store(write.unit, write.image):
                self.failed(write.unit)

    def cut(self) -> None:
        """Only the first `count` writes have happened."""
        del self._answers[max(self.count - self._first, 0) :]
        while self._waiting and self._waiting[-1].number >= self.count:
            self._waiting.pop()

    def forget(self, count: int) -> None:
        """Nobody goes back before the first `count` any more."""
        gone = count - self._first
        if gone > 0:
            del self._answers[:gone]
            self._first += gone
