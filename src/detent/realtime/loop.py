"""The loop that serves a cell: one thread between the wall clock, the cell and the endpoints of its lines.

A wake-up does everything that it makes possible: the cell catches up with the clock, bytes of clients go to
their lines, and what the hosts of the lines heard goes out. Characters count as sent when they are read; the
line then gives them their time. Then the loop sleeps until the next deadline of the cell or the next byte.

It sleeps to the microsecond (`realtime.polling`). What remains after that (`EARLY`) is spent looking at the descriptors
again and again, and nothing else for a while, so that what is due is seen sooner.
"""

import contextlib
import signal
import socket
import threading
from collections import defaultdict, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from pathlib import Path
from time import monotonic_ns
from typing import Any, Protocol, TypeAlias, TypeVar

from detent.lines.line import Heard
from detent.realtime import polling
from detent.realtime.endpoints.endpoint import Endpoint, Listener
from detent.realtime.pace import Pace, WallNs
from detent.realtime.system import ENDING
from detent.ticks import MS, SECOND, US, Ns
from detent.uart import Chars

EARLY: WallNs = 60 * US  # sleeping is given up so long before a deadline: no system wakes a sleeper to the microsecond
LOOKS = 64  # in a row, before the rest is seen to again
LONGEST_SLEEP: WallNs = 3600 * SECOND  # systems refuse to sleep for years, and nobody minds a wake-up an hour
LONGEST: WallNs = 2 * MS  # a cell that cannot keep pace lets the clients have a word so often
BEHIND = 64  # characters waiting on a line before its clients have to wait

T = TypeVar("T")

Wait: TypeAlias = Callable[
    [Sequence[int], Sequence[int], Sequence[int], float | None], tuple[list[int], list[int], list[int]]
]
"""Like `select.select`: wait until something can be read or written, or some seconds have passed."""


class ServedLine(Protocol):
    """What the loop needs of a line."""

    @property
    def host_busy_until(self) -> Ns:
        """When everything the host has sent is over."""

    def take(self) -> list[Heard]:
        """What has reached the host since the last call."""


class Served(Protocol):
    """What the loop needs of a cell."""

    @property
    def now(self) -> Ns:
        """Its time."""

    @property
    def lines(self) -> Sequence[ServedLine]:
        """The lines."""

    def next_event(self) -> Ns | None:
        """When something happens next by itself."""

    def run_to(self, until: Ns) -> None:
        """Let everything happen up to and including `until`."""

    def send(self, line: int, data: Chars) -> None:
        """The host of a line sends `data`, now."""


class Companion(Protocol):
    """What is served beside the cell and belongs to none of its lines: boards with real pins. Times are the pace's."""

    def reading(self) -> Sequence[int]:
        """Descriptors that may have something to read."""

    def writing(self) -> Sequence[int]:
        """Descriptors that wait for room."""

    def receive(self, descriptor: int) -> None:
        """Something can be read."""

    def flush(self, descriptor: int) -> None:
        """Something can be written."""

    def deadline(self) -> WallNs | None:
        """When `serve` is to be called at the latest."""

    def serve(self) -> None:
        """The cell is at its present, and what could be read was: called once in each wake-up."""


class Timer(Protocol):
    """What is done from time to time while the loop lives: the watchdog of a service manager. Times are the pace's."""

    def deadline(self) -> WallNs | None:
        """When `due` is to be called at the latest."""

    def due(self, wall: WallNs) -> None:
        """It may be time; called once in each wake-up."""


class Loop:
    """Serves `cell` at `pace`; `endpoints` are pairs of a line and what clients of it connect to.

    Several endpoints on a line share it: every one hears everything. `patience` is how far, in cell time, the
    host of each line may be behind before its clients have to wait. A `companion` is served along with it, and `timers`
    by the clock of the host.
    """

    def __init__(
        self,
        cell: Served,
        pace: Pace,
        endpoints: Sequence[tuple[int, Endpoint]],
        *,
        patience: Sequence[Ns] | None = None,
        wait: Wait = polling.wait,
        companion: Companion | None = None,
        timers: Sequence[Timer] = (),
    ) -> None:
        self._timers = tuple(timers)
        self._cell, self._pace, self._wait, self._companion = cell, pace, wait, companion
        self._endpoints = list(endpoints)
        self._of_line: dict[int, list[Endpoint]] = defaultdict(list)
        self._listeners: dict[int, list[Listener]] = defaultdict(list)
        for line, endpoint in endpoints:
            if isinstance(endpoint, Listener):
                self._listeners[line].append(endpoint)
            else:
                self._of_line[line].append(endpoint)
        self._patience = list(patience) if patience is not None else [0] * len(cell.lines)
        self._looking: WallNs = 0  # until when nothing is done but to look at the descriptors; 0: not at all
        self._stopping = False
        self._closed = False
        self._asked: deque[tuple[Callable[[], Any], Future[Any]]] = deque()  # of other threads
        self._woken, self._waker = socket.socketpair()  # and no pipe: not every system waits for pipes
        self._woken.setblocking(False)
        self._waker.setblocking(False)

    def run(self) -> None:
        """Serve until `stop`. Raises EndpointLost, and what the cell raises."""
        while not self._stopping:
            self.step()

    def stop(self) -> None:
        """End `run` soon. May be called from signal handlers and other threads."""
        self._stopping = True
        self._wake()

    def ask(self, function: Callable[[], T]) -> "Future[T]":
        """Call `function` soon on the thread that serves, when the cell is at its present; from any thread.

        What it returns or raises is in the future. A loop that ends cancels what it has not begun.
        """
        future: Future[T] = Future()
        self._asked.append((function, future))
        if self._closed:
            self._cancel()
        else:
            self._wake()
        return future

    @property
    def waker(self) -> int:
        """A file descriptor that wakes it when something is written there."""
        return self._waker.fileno()

    def _wake(self) -> None:
        with contextlib.suppress(BlockingIOError):  # full of earlier calls: it wakes all the same
            self._waker.send(b"\0")

    def _do_asked(self) -> None:
        for _ in range(len(self._asked)):
            function, future = self._asked.popleft()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(function())
            except Exception as error:  # whoever asked is told
                future.set_exception(error)

    def _cancel(self) -> None:
        while self._asked:
            self._asked.popleft()[1].cancel()

    def close(self) -> None:
        """Let go of what the loop holds itself; the endpoints are their owner's."""
        self._closed = True
        self._cancel()
        self._woken.close()
        self._waker.close()

    def step(self) -> None:
        """Wait until there is something to do, then do it."""
        cell, clock, lines = self._cell, self._pace.clock, self._cell.lines
        readers: dict[int, list[tuple[int, Endpoint]]] = {self._woken.fileno(): []}
        writers: dict[int, Endpoint] = {}
        for pair in self._endpoints:
            line, endpoint = pair
            room = lines[line].host_busy_until - cell.now <= self._patience[line]
            for descriptor in endpoint.reading(room):
                if descriptor in readers:
                    readers[descriptor].append(pair)  # several may share one that tells who comes and goes
                else:
                    readers[descriptor] = [pair]
            for descriptor in endpoint.writing():
                writers[descriptor] = endpoint
        companion = self._companion
        beside: tuple[Sequence[int], Sequence[int]] = ((), ())
        if companion is not None:
            beside = companion.reading(), companion.writing()

        reading, writing = [*readers, *beside[0]], [*writers, *beside[1]]
        readable, writable, _ = self._wait(reading, writing, (), self._timeout())
        for _ in range(LOOKS):
            if readable or writable or companion is not None or not 0 < self._looking - clock() <= EARLY:
                break
            readable, writable, _ = self._wait(reading, writing, (), 0.0)
        self._catch_up()
        if companion is not None:
            for descriptor in beside[0]:
                if descriptor in readable:
                    companion.receive(descriptor)
            for descriptor in beside[1]:
                if descriptor in writable:
                    companion.flush(descriptor)
            companion.serve()
        wall = clock()
        for descriptor in readable:
            if descriptor in beside[0]:
                continue
            if descriptor == self._woken.fileno():
                self._woken.recv(64)
                self._do_asked()
                cell.run_to(cell.now)  # whoever stands between takes note of what was done to it
                continue
            for line, endpoint in readers[descriptor]:
                data = endpoint.receive(descriptor, wall)
                if data:
                    cell.send(line, data)
        for descriptor in writable:
            if descriptor not in beside[1]:
                writers[descriptor].flush()
        self._tell(wall)
        for _, endpoint in self._endpoints:
            due = endpoint.deadline()
            if due is not None and due <= wall:
                endpoint.due(wall)
        for timer in self._timers:
            timer.due(monotonic_ns())

    def _timeout(self) -> float | None:
        """Seconds to sleep at most; None if only a client can start anything."""
        at = self._cell.next_event()
        due = None if at is None else self._pace.due(at)
        self._looking = 0 if due is None else due
        if due is not None:
            due -= EARLY
        for _, endpoint in self._endpoints:
            other = endpoint.deadline()
            if other is not None and (due is None or other < due):
                due = other
        if self._companion is not None:
            other = self._companion.deadline()
            if other is not None and (due is None or other < due):
                due = other
        left = LONGEST_SLEEP if due is None else due - self._pace.clock()
        times = [at - monotonic_ns() for timer in self._timers if (at := timer.deadline()) is not None]
        if due is None and not times:
            return None
        left = min(left, LONGEST_SLEEP, *times)
        return left / SECOND if left > 0 else 0.0

    def _catch_up(self) -> None:
        """Run the cell to the present, deadline by deadline, and note how late each was served."""
        cell, pace = self._cell, self._pace
        began = wall = pace.clock()
        present = pace.at(wall)
        while (at := cell.next_event()) is not None and at <= present:
            cell.run_to(at)
            wall = pace.clock()
            if not pace.free:
                pace.lateness.note(wall - (pace.due(at) or wall))
            if wall - began > LONGEST:
                return  # clients wait; the cell goes on where it was, and its lateness shows it
        if present > cell.now and not pace.free:
            cell.run_to(present)

    def _tell(self, wall: WallNs) -> None:
        """What the hosts heard goes to their clients."""
        for number, line in enumerate(self._cell.lines):
            heard = line.take()
            if heard:
                data = bytes([char.value & 0xFF for _, char in heard])
                for endpoint in self._of_line[number]:
                    endpoint.send(data, wall)
                for listener in self._listeners[number]:
                    listener.hear(heard, wall)


@contextlib.contextmanager
def stopped_by_signals(loop: Loop) -> Iterator[None]:
    """The signals that end a process stop `loop` while this lasts. For the main thread."""
    # a signal may reach another thread, and then it does not wake this one, which has to run the handlers
    descriptor = signal.set_wakeup_fd(loop.waker, warn_on_full_buffer=False)
    before = {number: signal.signal(number, lambda *_: loop.stop()) for number in ENDING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(descriptor)


def wake_exactly() -> None:
    """Ask the system not to put off this thread's wake-ups to save power (50 us on Linux), where it can be asked."""
    with contextlib.suppress(OSError):
        Path(f"/proc/{threading.get_native_id()}/timerslack_ns").write_text("1")
