"""Who has device files open: told by the system (inotify), where it can tell."""

import ctypes
import os
import struct
import sys
from collections.abc import Sequence

_EVENT = struct.Struct("iIII")  # watch, what, cookie, length of a name, which a file that is watched itself has not
_OPENED, _CLOSED = 0x20, 0x08 | 0x10  # IN_OPEN, IN_CLOSE_WRITE | IN_CLOSE_NOWRITE
_LOST = 0x4000  # IN_Q_OVERFLOW


class Openings:
    """What is told of any number of files, over one descriptor: a user has few of its kind (128 on Linux).

    `descriptor` is -1 before the first file is watched, and where the system does not tell.
    """

    def __init__(self) -> None:
        self.descriptor = -1
        self._library = ctypes.CDLL(None, use_errno=True) if sys.platform.startswith("linux") else None
        self._files: dict[int, Opened] = {}

    def watch(self, path: str, file: "Opened") -> int:
        """Tell `file` what happens to `path` from now on; the number of the watch, -1 if it cannot be told."""
        if self._library is None or not hasattr(self._library, "inotify_init1"):
            return -1
        if self.descriptor < 0:
            self.descriptor = self._library.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
        if self.descriptor < 0:
            return -1
        number: int = self._library.inotify_add_watch(self.descriptor, os.fsencode(path), _OPENED | _CLOSED)
        if number >= 0:
            self._files[number] = file
        elif not self._files:
            self.close()
        return number

    def forget(self, number: int) -> None:
        """Tell nothing of that watch any more; the last one ends it all."""
        if self._files.pop(number, None) is not None and self._library is not None:
            self._library.inotify_rm_watch(self.descriptor, number)
        if not self._files:
            self.close()

    def update(self) -> None:
        """Tell the files what has happened since the last call."""
        while self.descriptor >= 0:
            try:
                told = os.read(self.descriptor, 64 * _EVENT.size)
            except BlockingIOError:
                break
            for number, what, _, _ in _EVENT.iter_unpack(told):
                if what & _LOST:
                    self.close()  # it has lost count
                elif number in self._files:
                    self._files[number].note(what)

    def close(self) -> None:
        """Tell nothing any more: from now on somebody may have any of the files open. May be called twice."""
        self._files.clear()
        if self.descriptor >= 0:
            os.close(self.descriptor)
            self.descriptor = -1


class Opened:
    """Counts the openings of the file `path` from now on that have not been closed again.

    Where the system does not tell, there is somebody, always. Several may share `openings`; then every one of them has
    to `update` when its descriptor has something to read.
    """

    def __init__(self, path: str, openings: Openings | None = None) -> None:
        self._openings = Openings() if openings is None else openings
        self._count = 0
        self._left = False
        self._number = self._openings.watch(path, self)

    def reading(self) -> Sequence[int]:
        """What to watch for something to read."""
        return (self._openings.descriptor,) if self._openings.descriptor >= 0 else ()

    @property
    def somebody(self) -> bool:
        """Whether somebody has it open."""
        return self._number < 0 or self._openings.descriptor < 0 or self._count > 0

    def note(self, what: int) -> None:
        """The system tells that it was opened or closed."""
        if what & _OPENED:
            self._count += 1
        elif what & _CLOSED:
            self._count = max(self._count - 1, 0)
            self._left |= not self._count

    def update(self) -> bool:
        """Take in what has happened since the last call; True if the last one left meanwhile, if only for a moment."""
        self._openings.update()
        left, self._left = self._left, False
        return left

    def close(self) -> None:
        """Stop counting. May be called twice."""
        if self._number >= 0:
            self._openings.forget(self._number)
            self._number = -1
