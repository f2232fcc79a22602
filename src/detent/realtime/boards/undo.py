"""What a batch for a board changes: one that has gone stale before it is on the wire is taken back, and made anew.

A computer may be kept away at any time, also between the look at the clock from which ticks are reckoned and the write.
What is then in the batch comes too late, and the firmware would give up. So the clock is looked at once more behind
everything that takes time.
"""

from collections import deque
from collections.abc import Callable, Iterable

Undo = Callable[[], None]


def kept(thing: object) -> Undo:
    """Call it, and `thing` is as it is now: its attributes, and what is in its lists, tables and queues."""
    was = vars(thing).copy()
    for name, value in was.items():
        if isinstance(value, (list, dict, deque, bytearray)):
            was[name] = value.copy()
    return lambda: vars(thing).update(was)


def together(undos: Iterable[Undo]) -> Undo:
    """All of them."""
    undos = tuple(undos)

    def undo() -> None:
        for one in undos:
            one()

    return undo
