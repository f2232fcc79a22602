"""That whatever a client sets on a pseudo-terminal makes a difference, and at once.

Linux keeps 8 data bits and no parity on a pseudo-terminal, whatever a client asks for. The C library makes an error of
that (EINVAL) if nothing else that was asked for made a difference: a port would open in 7O2 once, and never again. So
something always is to make a difference: when a client has set something, the speed, which means nothing here, is set
to one that nobody uses. The kernel tells of settings in packet mode, with EXTPROC set; nothing else comes of both.

A program may set its port twice within 0.2 ms: pyserial does, when it opens it and then says ``port.timeout = 5``. No
loop that serves a cell is as quick as that, least of all on a busy computer. So a process beside it does nothing else:
this file, run by itself with nothing but the standard library (`unsettling.Unsettling` starts it).
"""

import ctypes
import os
import platform
import select
import signal
import socket
import struct
import sys
import termios
from contextlib import suppress
from typing import Final

UNUSUAL: Final = (termios.B134, termios.B150)  # two, for a client that looks before and after it has set something
TELLS: Final = sys.platform.startswith("linux")
"""Whether the kernel tells of what clients set, and refuses what it does not take."""

_EXTPROC: Final = 0o200000  # of the local flags, on Linux
_LFLAG, _ISPEED, _OSPEED = 3, 4, 5  # in what `tcgetattr` gives
_SCHED_SETATTR: Final = {"x86_64": 314, "aarch64": 274, "riscv64": 274, "armv7l": 380, "armv6l": 380, "i686": 351}
_TURN: Final = 100_000  # ns, the least that the scheduler knows
_PARENT: Final = 0  # the descriptor by which the process is told of terminals


def unsettle(descriptor: int, last: int) -> int:
    """Whatever a client sets next makes a difference, and is told. The speed for that: another than the `last` one."""
    settings = termios.tcgetattr(descriptor)
    if settings[_OSPEED] not in UNUSUAL or not settings[_LFLAG] & _EXTPROC:
        last = UNUSUAL[0] if last == UNUSUAL[1] else UNUSUAL[1]
        settings[_ISPEED] = settings[_OSPEED] = last
        settings[_LFLAG] |= _EXTPROC
        termios.tcsetattr(descriptor, termios.TCSANOW, settings)
    return last


def come_first() -> None:
    """Have the scheduler give this process its turns soon: by priority where it may, or else because they are short.

    It has little to do whenever a client has set something, and nothing in between.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except OSError:  # only for who is allowed to
        number = _SCHED_SETATTR.get(platform.machine())
        if number is not None:
            attributes = struct.pack("IIQiIQQQ", 48, 0, 0, 0, 0, _TURN, 0, 0)  # its size, SCHED_OTHER, no flags, ...
            with suppress(OSError, AttributeError):
                ctypes.CDLL(None).syscall(number, 0, attributes, 0)


def main() -> None:
    """Unsettle the terminals that come over the line to the parent, until that has gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    come_first()
    line = socket.socket(fileno=_PARENT)
    poll = select.epoll()
    poll.register(_PARENT, select.EPOLLIN)
    last: dict[int, int] = {}
    while True:
        for descriptor, events in poll.poll():
            if descriptor == _PARENT:
                told, [*descriptors], _, _ = socket.recv_fds(line, 1, 1)
                if not told:
                    return
                for one in descriptors:
                    last[one] = unsettle(one, UNUSUAL[1])
                    # at the edge: whoever serves takes the news when it has time
                    poll.register(one, select.EPOLLPRI | select.EPOLLET)
            elif events & ~select.EPOLLPRI:
                poll.unregister(descriptor)
                os.close(descriptor)
            else:
                last[descriptor] = unsettle(descriptor, last[descriptor])


if __name__ == "__main__":
    main()
