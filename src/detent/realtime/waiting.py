"""Waiting for something in a cell that is served, without looking again and again.

`Watched` stands between the loop and the cell. It looks at what is waited for after each eventful instant, and makes
instants of its own where a pulse brings an axis to a place or a time comes; so a cell can be let stand exactly there.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import NamedTuple

from detent.cell.cell import Cell
from detent.realtime.loop import Served, ServedLine
from detent.realtime.pace import Pace
from detent.realtime.verbs import Answer
from detent.realtime.watch import Watch
from detent.ticks import NEVER, Ns
from detent.uart import Chars


class Condition(NamedTuple):
    """Something that is so or not so at an instant; `next` is when it must be looked at even if nothing happens."""

    holds: Callable[[], bool]
    next: Callable[[], Ns] = lambda: NEVER


class _Waiter(NamedTuple):
    conditions: Sequence[Condition]
    then: Callable[[], None]
    future: "Future[Answer]"

    def over(self) -> bool:
        """Look whether it is so, and tell whoever waits; whether nobody waits any more."""
        if self.future.cancelled():
            return True
        if not all(condition.holds() for condition in self.conditions):
            return False
        if self.future.set_running_or_notify_cancel():
            self.then()
        return True


class Watched:
    """The cell as the loop serves it. It stands when its pace is held, also in the middle of catching up.

    Nothing is looked at while it is not `present`: then it shows what was.
    """

    def __init__(self, cell: Served, pace: Pace, present: Callable[[], bool] = lambda: True) -> None:
        self.cell, self._pace, self._present = cell, pace, present
        self._waiters: list[_Waiter] = []
        self.lost: Callable[[], Answer] = lambda: {"reached": False}  # the answer where what is waited for is no more

    @property
    def now(self) -> Ns:
        """The time of the cell."""
        return self.cell.now

    @property
    def lines(self) -> Sequence[ServedLine]:
        """Its lines."""
        return self.cell.lines

    def next_event(self) -> Ns | None:
        """When something happens, or must be looked at; nothing does while it stands."""
        if self._pace.held:
            return None
        at = self.cell.next_event()
        if self._waiters:
            waiters = [waiter for waiter in self._waiters if not waiter.future.cancelled()]
            alarm = min((condition.next() for waiter in waiters for condition in waiter.conditions), default=NEVER)
            if alarm < (NEVER if at is None else at):
                return max(alarm, self.cell.now)
        return at

    def run_to(self, until: Ns) -> None:
        """Let everything happen up to `until`, one eventful instant at a time."""
        if not self._pace.held:
            self.cell.run_to(until)
            self.look()

    def send(self, line: int, data: Chars) -> None:
        """The host of a line sends something."""
        self.cell.send(line, data)
        self.look()

    def wait(self, conditions: Sequence[Condition], then: Callable[[], Answer]) -> "Future[Answer]":
        """Call `then` at the first instant at which all conditions hold, which may be this one; its answer."""
        future: Future[Answer] = Future()

        def tell() -> None:
            try:
                future.set_result(then())
            except Exception as error:  # whoever waits is told
                future.set_exception(error)

        waiter = _Waiter(conditions, tell, future)
        if not (self._present() and waiter.over()):
            # those who wait no longer go now: a cell that stands is not looked at
            self._waiters = [*(other for other in self._waiters if not other.future.cancelled()), waiter]
        return future

    def look(self) -> None:
        """Look at everything that is waited for."""
        if self._waiters and self._present():
            self._waiters = [waiter for waiter in self._waiters if not waiter.over()]

    def give_up(self) -> None:
        """What is waited for is no more: everybody is told so."""
        waiters, self._waiters = self._waiters, []
        for waiter in waiters:
            if waiter.future.set_running_or_notify_cancel():
                waiter.future.set_result(self.lost())

    def close(self) -> None:
        """Nobody needs to wait any longer."""
        for waiter in self._waiters:
            waiter.future.cancel()
        self._waiters = []


def at_position(now: Callable[[], Cell], watch: Callable[[], Watch], unit: str, axis: str, position: int) -> Condition:
    """The axis of a unit is at a position. The pulse that brings it there is an instant to look at."""

    def holds() -> bool:
        cell = now()
        return cell.controller(unit).status(cell.now, axis).position == position

    def following() -> Ns:
        cell = now()
        controller, motion = cell.controller(unit), watch().of_unit[cell.unit(unit)].front.travels[axis].motion
        if motion is None:
            return NEVER
        missing = (position - controller.status(cell.now, axis).position) * motion.direction
        pulse = max(motion.train.steps_by(cell.now), motion.first - 1) + missing
        if missing <= 0 or (motion.train.steps is not None and pulse > motion.train.steps):
            return NEVER
        return motion.train.time_of(pulse)

    return Condition(holds, following)


def at_time(now: Callable[[], Cell], time: Ns) -> Condition:
    """The time of the cell has come."""
    return Condition(lambda: now().now >= time, lambda: time if now().now < time else NEVER)
