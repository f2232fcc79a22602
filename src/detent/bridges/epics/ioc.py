"""Motor records by Channel Access: caproto serves the fields, and every put goes to `MotorRecord`."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from contextvars import ContextVar
from math import isfinite
from typing import Any

import numpy
from caproto import (
    DBR_TYPES,
    AccessRights,
    AlarmSeverity,
    AlarmStatus,
    CaprotoRuntimeError,
    CAStatus,
    ChannelDouble,
    ChannelEnum,
    ChannelInteger,
    ChannelNumeric,
    ChannelType,
    Forbidden,
    SkipWrite,
    native_type,
)
from caproto.server import PVGroup, pvproperty

from detent.bridges.epics.fields import Alarm, Settings, Value
from detent.bridges.epics.motor import Motor, PutFailed
from detent.bridges.epics.record import MotorRecord
from detent.bridges.epics.server import Context, quietly
from detent.bridges.epics.values import check_number

_LIMITS = {
    "VAL": ("LLM", "HLM"), "RBV": ("LLM", "HLM"), "DVAL": ("DLLM", "DHLM"), "DRBV": ("DLLM", "DHLM"),
    "RVAL": ("RLLM", "RHLM"), "RRBV": ("RLLM", "RHLM"), "VELO": ("VBAS", "VMAX"),
}  # fmt: skip
"""The fields that show limits. Clients look at those of VAL before they put."""

_WHOLE = {ChannelType.INT: 15, ChannelType.LONG: 31}  # bits of a whole number, without its sign
_UNITS = 7  # characters of units that a client is told with a number
_STRING = 39  # of a string

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
        newer = _newer(group.motor.alarm)
        self.pvs: dict[str, Any] = {**group.pvdb, **{f"{name}.{field}": channel for field, channel in newer.items()}}
        self._channels: dict[str, Any] = {"VAL": group.motor, **group.motor.fields, **newer}
        for field, channel in self._channels.items():
            _let_all_types_be_read(channel)
            kept = self.record.takes(field) or field in self.record.fields
            channel.verify_value = self._put(field, channel) if kept else self._keep(field, channel)
            channel.auth_write = self._answered(field, channel)

    async def begin(self) -> None:
        """Ask the motor where it is and show everything. Raises DriverError, ValueError."""
        await self.record.begin()

    async def watch(self) -> None:
        """Look at the motor now and then, for ever."""
        await self.record.watch()

    async def post(self, field: str, value: Value) -> None:
        """Show a field; clients that monitor it are told."""
        channel = self._channels[field]
        await channel.write(_as_shown(channel, value), verify_value=False, update_fields=False)
        for limited, (low, high) in _LIMITS.items():
            if field in (low, high):
                ends = {"lower": self.record.fields[low], "upper": self.record.fields[high]}
                kinds = {f"{end}_{kind}_limit": at for end, at in ends.items() for kind in ("ctrl", "disp")}
                await self._channels[limited].write_metadata(**kinds)
        if field in ("EGU", "PREC"):
            told = {"units": _latin(str(value))[:_UNITS]} if field == "EGU" else {"precision": value}
            for other in self._channels.values():
                if hasattr(other, "units") and hasattr(other, "precision"):
                    await other.write_metadata(publish=False, **told)

    async def alarm(self, alarm: Alarm) -> None:
        """Show the alarm on the record and on all its fields."""
        status, severity = AlarmStatus[alarm.status], AlarmSeverity[alarm.severity]
        for own in {id(channel.alarm): channel.alarm for channel in self._channels.values()}.values():
            await own.write(status=status, severity=severity)

    def _put(self, field: str, channel: Any) -> Callable[[Any], Awaitable[None]]:
        """What the channel does with a value that a client puts, in place of judging it by its limits."""

        async def put(value: Any) -> None:
            try:
                if isinstance(value, str) and hasattr(channel, "enum_strings"):
                    value = channel.enum_strings.index(value)
                await self.record.put(field, value)
            except (PutFailed, ValueError) as error:
                self._fail(field, error)
            raise SkipWrite  # the record has shown what became of it

        return put

    def _keep(self, field: str, channel: Any) -> Callable[[Any], Awaitable[Any]]:
        """What a channel does that means nothing here: it keeps what can be kept."""
        usual = channel.verify_value

        async def keep(value: Any) -> Any:
            if isinstance(value, float) and not isfinite(value):
                self._fail(field, f"{value} is no number to keep")
                raise SkipWrite
            return await usual(value)

        return keep

    def _fail(self, field: str, why: object) -> None:
        _failed.set(True)
        self._report(f"{self.name}.{field}: {why}")

    def _answered(self, field: str, channel: Any) -> Callable[..., Awaitable[Any]]:
        """A channel's `auth_write` that returns the status for the client that waits, whatever the client has put."""
        write, numeric = channel.auth_write, isinstance(channel, ChannelNumeric)

        async def put(host: Any, user: Any, data: Any, data_type: Any, *given: Any, **named: Any) -> Any:
            _failed.set(False)
            try:
                if numeric and data_type == ChannelType.STRING:
                    check_number(data)
                with numpy.errstate(all="ignore"):
                    status = await write(host, user, data, data_type, *given, **named)
            except Forbidden:
                self._fail(field, "is the record's own: it is read, not put")
                return CAStatus.ECA_NOWTACCESS
            except Exception as error:  # of whatever type the client's value is, it is no value of this field
                self._fail(field, f"what was put is no value of it: {error}")
            return CAStatus.ECA_PUTFAIL if _failed.get() else status

        return put


def _newer(alarm: Any) -> dict[str, Any]:
    """The fields of today's motor record that caproto's does not have."""
    both: dict[str, Any] = {"alarm": alarm, "reported_record_type": "motor"}
    return {
        **{field: ChannelDouble(value=0.0, **both) for field in ("ACCS", "RHLM", "RLLM")},
        "ACCU": ChannelEnum(value=0, enum_strings=("Accl", "Accs"), **both),
        "RSTM": ChannelEnum(value=2, enum_strings=("Never", "Always", "NearZero", "Conditional"), **both),
        "CBAK": _Fixed(value=0, **both),
    }


class _Fixed(ChannelInteger):  # type: ignore[misc]
    """A number that clients read and do not put."""

    def check_access(self, hostname: str, username: str) -> AccessRights:
        return AccessRights.READ


def _as_shown(channel: Any, value: Value) -> Value:
    """`value` as the type of the channel has it: a number that it cannot hold is the nearest that it can."""
    if isinstance(value, str):
        return _latin(value)[:_STRING]
    if channel.data_type in _WHOLE:
        top = 1 << _WHOLE[channel.data_type]
        return min(max(int(value), -top), top - 1)
    return int(value) if channel.data_type == ChannelType.ENUM else float(value)


def _latin(text: str) -> str:
    return text.encode("latin-1", "replace").decode("latin-1")


def _let_all_types_be_read(channel: Any) -> None:
    """Have a channel give something in every type: a text that is no number reads as 0."""
    usual, data = channel._read, channel._data  # noqa: SLF001 (caproto has no other way in)
    if channel.data_type == ChannelType.STRING and not isinstance(data["value"], str):
        data["value"] = ""  # links are the number 0 in caproto

    async def read(data_type: Any) -> Any:
        with numpy.errstate(all="ignore"):
            try:
                return await usual(data_type)
            except Exception:  # a conversion that caproto does not know
                kind = ChannelType(data_type)
                plain = native_type(kind)
                nothing = bytes(40) if plain == ChannelType.STRING else numpy.zeros(1, _ON_THE_WIRE[plain])
                return (b"" if kind == plain else DBR_TYPES[kind]()), nothing

    channel._read = read  # noqa: SLF001 (likewise)


_ON_THE_WIRE = {
    ChannelType.INT: ">i2", ChannelType.FLOAT: ">f4", ChannelType.ENUM: ">u2", ChannelType.CHAR: "B",
    ChannelType.LONG: ">i4", ChannelType.DOUBLE: ">f8",
}  # fmt: skip


async def serve(
    motors: Sequence[ServedMotor],
    interfaces: Sequence[str] | None,
    ready: Callable[[int], None],
    report: Callable[[str], object],
) -> None:
    """Serve records that have begun until cancelled; `ready` is told the port once clients can connect.

    `report` is told what clients do that makes no sense. Raises OSError where it cannot listen.
    """
    pvs = {name: pv for motor in motors for name, pv in motor.pvs.items()}
    watching: list[asyncio.Task[None]] = []
    with quietly(report):
        context = Context(pvs, list(interfaces) if interfaces else None)

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
            await context.close()
