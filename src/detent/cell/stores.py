"""What units write to non-volatile memory, so that a past that is gone through again writes nothing a second time."""

from typing import NamedTuple

from detent.cell.outside import Store, no_store


class Stored(NamedTuple):
    """A unit has written, and whether that succeeded."""

    unit: str
    succeeded: bool


class Stores:
    """Give `save` to `build` as its store. `writes` is how many there were up to where the cell stands.

    Where it stands before the last of them, what comes gets the answer that it got then.
    """

    def __init__(self, store: Store = no_store) -> None:
        """`store` really writes."""
        self._store = store
        self._kept: list[Stored] = []
        self._begin = 0  # the number of the first that is kept
        self.writes = 0
        self.idle = False  # what happens is only tried: nothing is written, nothing kept, every write succeeds

    def save(self, unit: str, image: bytes) -> bool:
        """Write the image of a unit, or answer as when it was written."""
        if self.idle:
            self.writes += 1
            return True
        place = self.writes - self._begin
        self.writes += 1
        if place < len(self._kept):
            return self._kept[place].succeeded
        stored = Stored(unit, self._store(unit, image))
        self._kept.append(stored)
        return stored.succeeded

    def cut(self, writes: int) -> list[str]:
        """Only the first `writes` have happened: the units whose memory outside is no longer what they kept then."""
        undone = {stored.unit for stored in self._kept[writes - self._begin :] if stored.succeeded}
        del self._kept[writes - self._begin :]
        self.writes = writes
        return sorted(undone)

    def write_back(self, unit: str, image: bytes) -> None:
        """The memory of a unit outside is `image` again."""
        self._store(unit, image)

    def forget(self, writes: int) -> None:
        """Nobody goes back before the first `writes` any more."""
        del self._kept[: writes - self._begin]
        self._begin = writes
