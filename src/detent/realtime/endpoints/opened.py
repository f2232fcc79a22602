"""Who has a device file open: told by the system (inotify), where it can tell."""

import ctypes
import os
import struct
import sys
from collections.abc import Sequence

_EVENT = struct.Struct("iIII")  # watch, what, cookie, length of a name, which a file that is watched itself has not
_OPENED, _CLOSED = 0x20, 0x08 | 0x10  # IN_OPEN, IN_CLOSE_WRITE | IN_CLOSE_NOWRITE
_LOST = 0x4000  # IN_Q_OVERFLOW


class Opened:
    """Counts the openings of the file `path` from now on that have not been closed again.

    `descriptor` has something to read when that number changes; -1 where the system does not tell. Then there is
    somebody, always.
    """

    def __init__(self, path: str) -> None:
        self.descriptor = _watch(path)
        self._count = 0

    def reading(self) -> Sequence[int]:
        """What to watch for something to read."""
        return (self.descriptor,) if self.descriptor >= 0 else ()

    @property
    def somebody(self) -> bool:
        """Whether somebody has it open."""
        return self.descriptor < 0 or self._count > 0

    def update(self) -> bool:
        """Take in what has happened since the last call; True if the last one left meanwhile, if only for a moment."""
        left = False
        while self.descriptor >= 0:
            try:
                told = os.read(self.descriptor, 64 * _EVENT.size)
            except BlockingIOError:
                break
            for _, what, _, _ in _EVENT.iter_unpack(told):
                if what & _OPENED:
                    self._count += 1
                elif what & _CLOSED:
                    self._count = max(self._count - 1, 0)
                    left |= not self._count
                elif what & _LOST:
                    self.close()  # it has lost count
        return left

    def close(self) -> None:
        """Stop counting. May be called twice."""
        if self.descriptor >= 0:
            os.close(self.descriptor)
            self.descriptor = -1


def _watch(path: str) -> int:
    """An inotify descriptor that tells of openings and closings of `path`; -1 if there is none to be had."""
    if not sys.platform.startswith("linux"):
        return -1
    library = ctypes.CDLL(None, use_errno=True)
    try:
        descriptor: int = library.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
    except AttributeError:
        return -1
    if descriptor >= 0 and library.inotify_add_watch(descriptor, os.fsencode(path), _OPENED | _CLOSED) < 0:
        os.close(descriptor)
        return -1
    return descriptor
