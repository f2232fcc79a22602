"""A motor record over the driver of a unit, in the virtual time of an emulated cell."""

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import AbstractAsyncContextManager
from typing import Any

import pytest

from detent.bridges.epics.cells import axes
from detent.bridges.epics.fields import Alarm, Settings, Status
from detent.bridges.epics.motor import PutFailed
from detent.bridges.epics.record import MotorRecord
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.host import HostPort
from detent.realtime.connect import connect_async

ALL = ["gs-c200", "gs-c200s", "dcb-274", "supersigma", "bs0710"]


SETTINGS = Settings(resolution=0.01, egu="mm", low=-50, high=50, velocity=10, base=2)


class VirtualPort:
    """The line of a cell for coroutines. Time passes for who waits; the others have their turn in between."""

    def __init__(self, cell: Cell, line: int) -> None:
        self._port = HostPort(cell, line)
        self._turn = asyncio.Lock()
        self.out = False  # the cable

    async def write(self, data: bytes) -> None:
        if self.out:
            raise OSError(5, "the cable is out")
        self._port.write(data)

    async def receive(self, timeout: float) -> bytes:
        await asyncio.sleep(0)
        return self._port.receive(timeout)

    def keep(self, data: bytes) -> None:
        self._port.keep(data)

    async def wait(self, seconds: float) -> None:
        self._port.wait(seconds)
        await asyncio.sleep(0)

    def clock(self) -> float:
        return self._port.clock()

    def turn(self) -> AbstractAsyncContextManager[object]:
        return self._turn

    async def close(self) -> None:
        pass


class Shown:
    """What a record has shown."""

    def __init__(self) -> None:
        self.posts: list[tuple[str, Any]] = []
        self.alarms: list[Alarm] = []

    async def post(self, field: str, value: Any) -> None:
        self.posts.append((field, value))

    async def alarm(self, alarm: Alarm) -> None:
        self.alarms.append(alarm)

    def of(self, field: str) -> list[Any]:
        return [value for name, value in self.posts if name == field]


class Bench:
    """A record over a unit of a cell that `text` describes, or of the only one of a model."""

    def __init__(self, text: str, settings: Settings = SETTINGS, axis: int = 0) -> None:
        text = text if "\n" in text else f'[units.unit]\nmodel = "{text}"\n'
        description = parse(text, "bench")
        self.cell = build(description, lambda file: "")
        self.axis = axes(description, self.cell)[axis]
        self.port = VirtualPort(self.cell, self.axis.line)
        self.shown = Shown()
        self._settings = settings

    async def begin(self) -> MotorRecord:
        self.motor = await connect_async(self.axis.model, self.port, **self.axis.options)
        self.record = MotorRecord(self.motor, self.shown, self._settings)
        await self.record.begin()
        self.shown.posts.clear()
        return self.record

    def __getitem__(self, field: str) -> Any:
        return self.record.fields[field]

    def status(self) -> Status:
        return Status(self["MSTA"])

    async def until(self, so: Callable[[], object]) -> None:
        while not so():
            await asyncio.sleep(0)

    def shaft(self) -> int:
        name = self.axis.title.partition(" ")[0]
        return self.cell.controller(name).status(self.cell.now).position


def run(test: Callable[[], Coroutine[Any, Any, None]]) -> None:
    asyncio.run(test())


async def failure(put: Awaitable[None]) -> str:
    with pytest.raises(PutFailed) as caught:
        await put
    return str(caught.value)
