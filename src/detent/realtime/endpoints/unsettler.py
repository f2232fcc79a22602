"""That whatever a client sets on a pseudo-terminal makes a difference, and at once.

Linux keeps 8 data bits and no parity on a pseudo-terminal, whatever a client asks for. The C library makes an error of
that (EINVAL) if nothing else that was asked for made a difference: a port would open in 7O2 once, and never again. So
something always is to make a difference: when a client has set something, the speed, which means nothing here, is set
to one that nobody uses. The kernel tells of settings in packet mode, with EXTPROC set; nothing else comes of both.

A program may set its port twice within 0.2 ms: pyserial does, when it opens it and then says ``port.timeout = 5``. No
loop that serves a cell is as quick as that. So this file, run by itself with nothing but the standard library
(`unsettling.Unsettling` starts it), is a process for each processor, which stays there and does nothing else: the one
on the client's processor takes its turn before the client goes on, however busy the computer is.
Decision 33 says why.
"""

import ctypes
import fcntl
import gc
import mmap
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

TELLS: Final = sys.platform.startswith("linux")
"""Whether the kernel tells of what clients set, and refuses what it does not take."""

UNUSUAL: Final = tuple(
    getattr(termios, f"B{speed}", 0) for speed in (1_152_000, 1_500_000, 2_000_000, 2_500_000, 3_000_000, 3_500_000)
)
"""Speeds that nobody uses. The C library looks before and after it has set something, so it must not find the same one
twice: whoever serves has the first two in turn, the processes beside it the others, with one turn among them."""
SERVING: Final = UNUSUAL[:2]
BESIDE: Final = UNUSUAL[2:]

_MOST: Final = 16  # processes
_SETTINGS: Final = 64  # bytes, more than the kernel's own settings have on any machine
_FLAGS: Final = struct.Struct("II")  # the control flags with the speed, and the local flags
_FLAGS_AT: Final = 8  # behind those for input and output
_SPEED: Final = getattr(termios, "CBAUD", 0)
_EXTPROC: Final = 0o200000  # of the local flags
_SCHED_SETATTR: Final = {"x86_64": 314, "aarch64": 274, "riscv64": 274, "armv7l": 380, "armv6l": 380, "i686": 351}
_TURN: Final = 100_000  # ns, the least that the scheduler knows
_NUMBER: Final = struct.Struct("H")  # of a terminal, as the processes are told of it
_PARENT: Final = 0  # the descriptor by which the process is told of terminals


def unsettle(descriptor: int, speeds: tuple[int, ...], turns: bytearray | mmap.mmap, number: int = 0) -> None:
    """Whatever a client sets next makes a difference, and is told: the terminal gets the next of `speeds`.

    Whose turn it is stands at `number` in `turns`. The kernel is asked directly: the way through the C library takes
    three times as long, and what a client sets meanwhile would be lost.
    """
    settings = bytearray(_SETTINGS)
    fcntl.ioctl(descriptor, termios.TCGETS, settings)
    control, local = _FLAGS.unpack_from(settings, _FLAGS_AT)
    if control & _SPEED in UNUSUAL and local & _EXTPROC:
        return
    turns[number] = turn = (turns[number] + 1) % len(speeds)
    _FLAGS.pack_into(settings, _FLAGS_AT, control & ~_SPEED | speeds[turn], local | _EXTPROC)
    fcntl.ioctl(descriptor, termios.TCSETS, settings)


def main() -> None:
    """Unsettle the terminals that come over the line to the parent, until that has gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    line = socket.socket(fileno=_PARENT)
    turns = mmap.mmap(-1, mmap.PAGESIZE)
    beside: list[socket.socket] = []
    processors = sorted(os.sched_getaffinity(0))
    for first in range(min(_MOST, len(processors))):
        ours, theirs = socket.socketpair()
        try:
            process = os.fork()
        except OSError:  # no more to be had: those there are do what they can
            break
        if process == 0:
            try:
                for one in (line, ours, *beside):
                    one.close()
                _come_first({*processors[first::_MOST]})
                _tend(theirs, turns)
            finally:
                os._exit(0)
        theirs.close()
        beside.append(ours)
    terminals = 0
    while True:
        told, descriptors, _, _ = socket.recv_fds(line, 1, 1)
        if not told:
            break
        for one in beside:
            with suppress(OSError):  # somebody ended it
                socket.send_fds(one, [_NUMBER.pack(terminals % len(turns))], descriptors)
        for descriptor in descriptors:
            os.close(descriptor)
        terminals += 1
    for one in beside:
        one.close()
    with suppress(ChildProcessError):
        while True:
            os.wait()


def _come_first(processors: set[int]) -> None:
    """Stay on `processors`, and get turns there soon: by priority where that is allowed, else as short ones.

    There is little to do whenever a client has set something, and nothing in between.
    """
    gc.disable()
    with suppress(OSError):
        os.sched_setaffinity(0, processors)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except OSError:  # only for who is allowed to
        number = _SCHED_SETATTR.get(platform.machine())
        if number is not None:
            attributes = struct.pack("IIQiIQQQ", 48, 0, 0, 0, 0, _TURN, 0, 0)  # its size, SCHED_OTHER, no flags, ...
            with suppress(OSError, AttributeError):
                ctypes.CDLL(None).syscall(number, 0, attributes, 0)


def _tend(line: socket.socket, turns: mmap.mmap) -> None:
    """Unsettle the terminals that come over `line`, each with its place in `turns`, until that has ended."""
    poll = select.epoll()
    poll.register(line, select.EPOLLIN)
    places: dict[int, int] = {}
    while True:
        for descriptor, events in poll.poll():
            if descriptor == line.fileno():
                told, [*descriptors], _, _ = socket.recv_fds(line, _NUMBER.size, 1)
                if not told:
                    return
                for one in descriptors:
                    (places[one],) = _NUMBER.unpack(told)
                    # at the edge: whoever serves takes the news when it has time
                    poll.register(one, select.EPOLLPRI | select.EPOLLET)
                    unsettle(one, BESIDE, turns, places[one])
            elif events & ~select.EPOLLPRI:
                poll.unregister(descriptor)
                os.close(descriptor)
            else:
                unsettle(descriptor, BESIDE, turns, places[descriptor])


if __name__ == "__main__":
    main()
