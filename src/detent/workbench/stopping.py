"""One STOP for everything that may move outside this computer: real units, boards, whoever says how it is stopped.

Windows call ``stop_all``, by the red key above every page or by Esc twice. It is there as long as somebody is.
"""

import asyncio
from collections.abc import Awaitable, Callable
from typing import TypeAlias

from detent.workbench.live import Live
from detent.workbench.stops import UNITS

Stop: TypeAlias = Callable[[], Awaitable[str]]
"""Stops something, and tells in words what came of it. Raises where that is not known to have worked."""


class StopFailed(RuntimeError):
    """Something was told to stop and may go on. The text says what, and what to do."""


class Stopping:
    """Who can be stopped, by name; ``stop.able`` of the table has their names."""

    def __init__(self, live: Live) -> None:
        """Offers ``stop_all``."""
        self._live = live
        self._stops: dict[str, Stop] = {}
        self._tell()
        live.offer("stop_all", self.stop_all, stops=True)

    def add(self, name: str, stop: Stop) -> None:
        """`stop` belongs to STOP from now on."""
        self._stops[name] = stop
        self._tell()

    def remove(self, name: str) -> None:
        """Nothing of that name is left to be stopped."""
        self._stops.pop(name, None)
        self._tell()

    async def stop_all(self) -> list[str]:
        """Stop all of them at once; what came of each. Raises StopFailed with what may still move."""
        names = list(self._stops)
        self._live.stops.stop(UNITS, *names)
        told = await asyncio.gather(*(stop() for stop in list(self._stops.values())), return_exceptions=True)
        failed = [f"{name}: {one}" for name, one in zip(names, told, strict=True) if isinstance(one, BaseException)]
        if failed:
            raise StopFailed("; ".join(failed))
        return [f"{name}: {one}" for name, one in zip(names, told, strict=True)]

    def _tell(self) -> None:
        self._live.put({"stop.able": sorted(self._stops)})
