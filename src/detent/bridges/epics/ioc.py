"""Motor records by Channel Access: caproto serves the fields, and every put goes to `MotorRecord`."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from contextvars import ContextVar
from typing import Any

from caproto import AlarmSeverity, AlarmStatus, CaprotoRuntimeError, CAStatus, SkipWrite
from caproto.asyncio.server import Context
from caproto.server import PVGroup, pvproperty

from detent.bridges.epics.fields import Alarm, Settings, Value
from detent.bridges.epics.record import Motor, MotorRecord, PutFailed

_LIMITS = {"VAL": ("LLM", "HLM"), "RBV": ("LLM", "HLM"), "DVAL": ("DLLM", "DHLM"), "DRBV": ("DLLM", "DHLM")}
"""The fields that show limits. Clients look at those of VAL before they put."""

_failed: ContextVar[bool] = ContextVar("failed", default=False)  # the put that this task carries out did


class _Group(PVGroup):  # type: ignore[misc]  # caproto has no types
    motor = pvproperty(value=0.0, name="", record="motor")


class ServedMotor:
    """The motor record `name` of `motor`: `pvs` are what a server serves, `begin` and `watch` as of `MotorRecord`.

    `report` is told of each put that failed, and why.
    """

    def __init__(self, name: str, motor: Motor, settings: Settings, report: Callable[[str], object]) -> None:
        self.name, self._report = name, report
        self.record = MotorRecord(motor, self, settings)
        self._settings = settings
        group = _Group(prefix=name)
        self.pvs: dict[str, Any] = dict(group.pvdb)
        self._channels: dict[str, Any] = {"VAL": group.motor, **group.motor.fields}
        for field, channel in self._channels.items():
            if self.record.takes(field) or field in self.record.fields:
                channel.verify_value = self._put(field, channel)
                channel.write_from_dbr = _told_whether_it_failed(channel.write_from_dbr)

    async def begin(self) -> None:
        """Ask the motor where it is and show everything. Raises DriverError, ValueError."""
        units, digits = self._settings.egu, self._settings.precision
        for channel in self._channels.values():
            if hasattr(channel, "units") and hasattr(channel, "precision"):
                await channel.write_metadata(units=units, precision=digits, publish=False)
        await self.record.begin()

    async def watch(self) -> None:
        """Look at the motor now and then, for ever."""
        await self.record.watch()

    async def post(self, field: str, value: Value) -> None:
        """Show a field; clients that monitor it are told."""
        channel = self._channels.get(field)
        if channel is None:
            return  # a field of motor records that caproto does not have
        await channel.write(value, verify_value=False, update_fields=False)
        for limited, (low, high) in _LIMITS.items():
            if field in (low, high):
                ends = {"lower": self.record.fields[low], "upper": self.record.fields[high]}
                kinds = {f"{end}_{kind}_limit": at for end, at in ends.items() for kind in ("ctrl", "disp")}
                await self._channels[limited].write_metadata(**kinds)

    async def alarm(self, alarm: Alarm) -> None:
        """Show the alarm on the record and on all its fields."""
        status, severity = AlarmStatus[alarm.status], AlarmSeverity[alarm.severity]
        for own in {id(channel.alarm): channel.alarm for channel in self._channels.values()}.values():
            await own.write(status=status, severity=severity)

    def _put(self, field: str, channel: Any) -> Callable[[Any], Awaitable[None]]:
        """What the channel does with a value that a client puts, in place of judging it by its limits."""

        async def put(value: Any) -> None:
            if isinstance(value, str) and hasattr(channel, "enum_strings"):
                value = channel.enum_strings.index(value)
            try:
                await self.record.put(field, value)
            except PutFailed as error:
                _failed.set(True)
                self._report(f"{self.name}.{field}: {error}")
            raise SkipWrite  # the record has shown what became of it

        return put


def _told_whether_it_failed(write: Callable[..., Awaitable[Any]]) -> Callable[..., Awaitable[Any]]:
    """A channel's `write_from_dbr` that returns the status for the client that waits."""

    async def put(*given: Any, **named: Any) -> Any:
        _failed.set(False)
        status = await write(*given, **named)
        return CAStatus.ECA_PUTFAIL if _failed.get() else status

    return put


async def serve(motors: Sequence[ServedMotor], interfaces: Sequence[str] | None, ready: Callable[[int], None]) -> None:
    """Serve records that have begun until cancelled; `ready` is told the port once clients can connect.

    Raises OSError where it cannot listen.
    """
    pvs = {name: pv for motor in motors for name, pv in motor.pvs.items()}
    context = Context(pvs, list(interfaces) if interfaces else None)
    watching: list[asyncio.Task[None]] = []

    async def started(_: object) -> None:
        ready(context.port)
        watching.extend(asyncio.create_task(motor.watch()) for motor in motors)

    try:
        await context.run(startup_hook=started)
    except CaprotoRuntimeError as error:
        raise OSError(str(error)) from error
    finally:
        for task in watching:
            task.cancel()
