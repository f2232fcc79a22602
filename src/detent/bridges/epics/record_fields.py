"""The fields of a motor record: how its numbers hang together, and how they are shown."""

from collections.abc import Mapping

from detent.bridges.epics.fields import (
    COMMUNICATION,
    FAILED,
    NEGATIVE,
    NO_ALARM,
    Alarm,
    Settings,
    Status,
    Value,
)
from detent.bridges.epics.motor import Outlet
from detent.hosts.axis import Limits


class RecordFields:
    """The fields by name, each shown by the outlet as it changes. `raw` is where the motor was seen last, in steps.

    Positions are dial (raw times MRES), user (dial times the sign of DIR, plus OFF) or raw.
    """

    def __init__(self, settings: Settings, outlet: Outlet) -> None:
        self._values: dict[str, Value] = settings.fields()
        self._outlet = outlet
        self._alarm = NO_ALARM
        self.raw = 0
        self.status = Status(0)  # what lasts: homed, a problem, no communication

    def __getitem__(self, field: str) -> Value:
        return self._values[field]

    @property
    def values(self) -> Mapping[str, Value]:
        """All of them."""
        return self._values

    async def show_all(self) -> None:
        """Show every field."""
        for field, value in self._values.items():
            await self._outlet.post(field, value)

    async def judge_place(self) -> None:
        """LVIO is whether the axis stands beyond a limit, by more than a step."""
        here, step = self.number("DRBV"), abs(self.number("MRES"))
        low, high = self.number("DLLM"), self.number("DHLM")
        await self.set(LVIO=int(self.limited and not low - step <= here <= high + step))

    async def show_limits(self) -> None:
        """The dial limits as user and raw ones."""
        low, high = self.number("DLLM"), self.number("DHLM")
        raw = sorted(end / self.number("MRES") for end in (low, high))
        user = sorted(self.user(end) for end in (low, high))
        await self.set(HLM=user[1], LLM=user[0], RHLM=raw[1], RLLM=raw[0])

    @property
    def sign(self) -> int:
        """Of user over dial."""
        return -1 if self._values["DIR"] == NEGATIVE else 1

    @property
    def raw_sign(self) -> int:
        """Of raw over user."""
        return self.sign if self.number("MRES") > 0 else -self.sign

    def number(self, field: str) -> float:
        """The value of a field that is a number."""
        value = self._values[field]
        assert not isinstance(value, str)
        return value

    def user(self, dial: float) -> float:
        """The user position of a dial position."""
        return dial * self.sign + self.number("OFF")

    def whole(self, field: str) -> int:
        """The value of a field that is a whole number."""
        return int(self.number(field))

    @property
    def limited(self) -> bool:
        """Both limits at 0 are none."""
        return bool(self._values["DLLM"] or self._values["DHLM"])

    def beyond(self, dial: float) -> bool:
        """Whether it is outside the limits, by more than a number that is written in digits may differ from one."""
        low, high = self.number("DLLM"), self.number("DHLM")
        slack = abs(self.number("MRES")) * 1e-6
        return self.limited and not low - slack <= dial <= high + slack

    def inside(self, limit: float, step: float) -> int:
        """The last whole step that is not beyond the limit, high or low."""
        raw = round(limit / step)
        inwards = 1 if (limit == self.number("DLLM")) == (step > 0) else -1
        return raw + inwards if self.beyond(raw * step) else raw

    async def set(self, **values: Value) -> None:
        """Give fields values, and show those that are new."""
        for field, value in values.items():
            if self._values.get(field) != value:
                self._values[field] = value
                await self._outlet.post(field, value)

    async def aim(self, dial: float, *, again: bool = False) -> None:
        """The target is `dial`; with `again` VAL and its like are shown even if they are no news to the record."""
        raw = round(dial / self.number("MRES"))
        if again:
            for field in ("VAL", "DVAL", "RVAL"):
                self._values.pop(field)
        await self.set(VAL=self.user(dial), DVAL=dial, RVAL=raw)
        await self._show_difference()

    async def follow_place(self) -> None:
        """The target is where the motor is."""
        await self.aim(self.raw * self.number("MRES"), again=True)

    async def show_place(self, met: Limits | None = None) -> None:
        """Show the readback and, where they are known, the limit switches."""
        dial = self.raw * self.number("MRES")
        await self.set(RRBV=self.raw, RMP=self.raw, REP=self.raw, DRBV=dial, RBV=self.user(dial))
        await self._show_difference()
        if met is not None:
            low, high = int(met.low or False), int(met.high or False)
            await self.set(RHLS=high, RLLS=low)
            if self.raw_sign < 0:
                low, high = high, low
            await self.set(HLS=high, LLS=low)
            await self.show_status(done=not self._values["MOVN"])

    async def _show_difference(self) -> None:
        difference = self.number("DVAL") - self.number("DRBV")
        await self.set(DIFF=difference, RDIF=round(difference / self.number("MRES")))

    async def show_status(self, *, done: bool = False) -> None:
        """MSTA from what lasts, the limit switches, and whether it is `done`."""
        status = self.status | (Status.DONE if done else Status.MOVING)
        status |= Status.PLUS_LIMIT if self._values["RHLS"] else Status(0)
        status |= Status.MINUS_LIMIT if self._values["RLLS"] else Status(0)
        await self.set(MSTA=int(status))

    async def alarm(self, alarm: Alarm) -> None:
        """The record has this alarm, or `NO_ALARM`."""
        if alarm != self._alarm:
            self._alarm = alarm
            await self._outlet.alarm(alarm)

    async def lose(self, error: Exception) -> None:
        """Something went wrong: raise the alarm that says of which kind."""
        if isinstance(error, OSError):  # NoAnswer and PortLost are such
            self.status |= Status.NO_COMMUNICATION
            await self.alarm(COMMUNICATION)
        else:
            await self.alarm(FAILED)
        await self.show_status(done=True)
