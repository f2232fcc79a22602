"""What not every system has: locks on files, terminals, signals, descriptors that a child inherits.

Modules that the rest needs ask here, so that none of them fails to load where a part of POSIX is missing.
"""

import os
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    import asyncio

fcntl: ModuleType | None
termios: ModuleType | None
try:
    import fcntl
except ImportError:
    fcntl = None
try:
    import termios
except ImportError:
    termios = None

TerminalError: Final[type[Exception]] = OSError if termios is None else termios.error
"""What a terminal raises besides OSError."""

INHERITS: Final = fcntl is not None
"""Whether a child process can be given an open descriptor."""

ENDING: Final = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""The signals that end what is served."""

NO_LINK: Final[int] = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
"""How files are opened in whose place nobody shall put a link; no child inherits them."""

NO_WAIT: Final[int] = getattr(os, "O_NONBLOCK", 0)
"""How files are opened that may turn out to be none."""


def lock(descriptor: int) -> None:
    """Have an open file for this process alone, until it is closed; where the system has no such locks, in name only.

    BlockingIOError if another process has it; OSError if the file cannot be locked.
    """
    if fcntl is not None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def reuse_address(listener: socket.socket) -> None:
    """Let a listening socket have an address whose last owner has just ended; elsewhere that would mean to share it."""
    if os.name == "posix":
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)


@contextmanager
def ended_by_signals(loop: "asyncio.AbstractEventLoop", end: Callable[[], object]) -> Iterator[None]:
    """The signals that end a process call `end` on an asyncio loop while this lasts. For the main thread."""
    try:
        for number in ENDING:
            loop.add_signal_handler(number, end)
    except NotImplementedError:  # of a loop that knows no signals
        before = {number: signal.signal(number, lambda *_: loop.call_soon_threadsafe(end)) for number in ENDING}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
        return
    try:
        yield
    finally:
        for number in ENDING:
            loop.remove_signal_handler(number)
