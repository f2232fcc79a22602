"""Waiting for descriptors, however many there are, without losing microseconds of a deadline.

`select` sleeps to the microsecond, but takes no descriptor from 1 024 on (`FD_SETSIZE`); `poll` takes any, and rounds a
timeout up to whole milliseconds. So `poll` is used for large descriptors only, and its timeouts are rounded down: what
is left, less than a millisecond, is spent looking again and again.
"""

import contextlib
import select
from collections.abc import Sequence
from typing import Final

FEW: Final = 1024  # `select` takes descriptors below
ENOUGH: Final = 1 << 16  # descriptors: 16 000 lines


def wait(
    reading: Sequence[int], writing: Sequence[int], exceptional: Sequence[int], timeout: float | None
) -> tuple[list[int], list[int], list[int]]:
    """Like `select.select`, for any descriptors; it may come back up to a millisecond early. `exceptional` is empty."""
    if max((*reading, *writing), default=0) < FEW or not hasattr(select, "poll"):
        return select.select(reading, writing, exceptional, timeout)
    wanted: dict[int, int] = dict.fromkeys(reading, select.POLLIN)
    for descriptor in writing:
        wanted[descriptor] = wanted.get(descriptor, 0) | select.POLLOUT
    poll = select.poll()
    for descriptor, events in wanted.items():
        poll.register(descriptor, events)
    found = poll.poll(None if timeout is None else int(timeout * 1000))
    # what has hung up or broken is ready for whatever was to be done with it, as `select` has it
    readable = [one for one, events in found if events & ~select.POLLOUT and wanted[one] & select.POLLIN]
    writable = [one for one, events in found if events & ~select.POLLIN and wanted[one] & select.POLLOUT]
    return readable, writable, []


def allow_many() -> None:
    """Have the system give this process as many descriptors as it may have: 1 024 are the custom, for `select`."""
    try:
        import resource
    except ImportError:  # a system without such a limit
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = ENOUGH if hard == resource.RLIM_INFINITY else min(hard, ENOUGH)
    if soft != resource.RLIM_INFINITY and soft < most:
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
