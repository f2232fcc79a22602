"""Instants that somebody waits for: time comes to them at max as well, where nothing else may be due."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from detent.realtime.waiting import Condition, Watched
from detent.ticks import NEVER, Ns


class Alarms:
    """One for each who waits, of a cell that is `watched` and whose time is `now()`."""

    def __init__(self, watched: Watched, now: Callable[[], Ns]) -> None:
        self._watched, self._now = watched, now
        self._set: dict[str, Future[dict[str, Any]]] = {}

    def set(self, who: str, at: Ns | None) -> None:
        """Let time come to `at` for `who`, in place of what he waited for before; None: for nothing any more."""
        before = self._set.pop(who, None)
        if before is not None:
            before.cancel()
        if at is not None:
            now = self._now
            due = Condition(lambda: now() >= at, lambda: at if now() < at else NEVER)
            self._set[who] = self._watched.wait([due], dict)
