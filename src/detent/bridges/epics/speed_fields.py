"""The speeds of a motor record: how its fields hang together, and what the motor makes of them."""

import asyncio
from typing import Final

from detent.bridges.epics.fields import ACCL, ACCS, Value
from detent.bridges.epics.motor import Motor, PutFailed
from detent.bridges.epics.record_fields import RecordFields
from detent.hosts.axis import Speeds
from detent.hosts.errors import DriverError

TRIES: Final = 10  # to find a rate that a unit does not round up beyond the largest one
SPEEDS: Final = ("VELO", "VBAS", "VMAX", "ACCL", "ACCS", "ACCU")


class SpeedFields:
    """`SPEEDS` among the fields of a record. `free` is held while the motor is given its speeds."""

    def __init__(self, fields: RecordFields, motor: Motor, free: asyncio.Lock) -> None:
        self._fields, self._motor, self._free = fields, motor, free
        self._tuned = False  # the motor has the speeds of the fields
        self._good = {name: fields[name] for name in SPEEDS}  # the speeds that it took last
        self._locked = fields.number("ACCS")  # the acceleration that stays, where ACCU says so

    async def begin(self) -> None:
        """Without a largest rate it is that of the unit. Raises ValueError for one that the unit does not do."""
        if not self._fields["VMAX"]:
            await self._fields.set(VMAX=self.most)
            self._good["VMAX"] = self.most
        most = self._fields.number("VMAX")
        if most > self.most * (1 + 1e-9):
            raise ValueError(f"the largest velocity {most:g}: the unit does {self.most:g} at most")

    def forget(self) -> None:
        """The motor may have other speeds by now."""
        self._tuned = False

    def scale(self, ratio: float) -> dict[str, Value]:
        """What velocities and the acceleration are when each is `ratio` times what it was."""
        scaled = {name: self._fields.number(name) * ratio for name in ("VELO", "VBAS", "VMAX", "ACCS")}
        self._locked *= ratio
        self._good |= scaled
        return dict(scaled)

    async def put(self, field: str, value: float) -> None:
        """A client puts one of `SPEEDS`. If the unit refuses it, all are what they were. Raises PutFailed."""
        old = {name: self._fields[name] for name in SPEEDS}
        locked = self._locked
        await self._fields.set(**self._with_speed(field, value))
        self._tuned = False
        if self._fields["MOVN"]:
            return  # the next motion has it
        async with self._free:
            try:
                await self.tune()
            except (DriverError, OSError, ValueError) as error:
                self._tuned, self._locked = False, locked
                await self._fields.set(**old)
                raise PutFailed(str(error)) from error

    def _with_speed(self, field: str, value: float) -> dict[str, Value]:
        """All of `SPEEDS` after a put: velocities within VBAS and VMAX, and one acceleration, of two that are kept."""
        new = {name: self._fields.number(name) for name in SPEEDS} | {field: value}
        if field in ("ACCL", "ACCS"):
            new["ACCU"] = ACCS if field == "ACCS" else ACCL
        if (field in ("ACCS", "VMAX", "VELO", "VBAS") and not value >= 0) or (field == "ACCS" and not value):
            raise PutFailed(f"{value:g} is too little")
        most = self.most
        new["VMAX"] = min(new["VMAX"], most) or most  # 0: what the unit can do, as without an option
        if new["VMAX"]:
            new["VBAS"], new["VELO"] = min(new["VBAS"], new["VMAX"]), min(new["VELO"], new["VMAX"])
        new["VELO"] = max(new["VELO"], new["VBAS"])
        if field in ("ACCS", "ACCU"):
            self._locked = new["ACCS"]
        if new["ACCU"] == ACCS and self._locked:
            new["ACCL"] = new["VELO"] / self._locked
        new["ACCS"] = new["VELO"] / new["ACCL"] if new["ACCL"] > 0 else 0.0
        return {**new, "ACCU": int(new["ACCU"])}

    @property
    def most(self) -> float:
        """The largest rate of the unit in units/s."""
        return self._motor.fastest * abs(self._fields.number("MRES"))

    def asked(self) -> Speeds:
        """The speeds of the fields, in steps."""
        step = abs(self._fields.number("MRES"))
        return Speeds(
            self._fields.number("VBAS") / step, self._fields.number("VELO") / step, self._fields.number("ACCL")
        )

    async def tune(self) -> None:
        """Give the motor its speeds, and show what it makes of them."""
        if not self._tuned:
            step = abs(self._fields.number("MRES"))
            try:
                made = await self._made(self.asked(), self._fields.number("VMAX") / step)
            except ValueError:
                await self._fields.set(**self._good)  # what it cannot do does not stay
                raise
            self._tuned = True
            slope = made.slew * step / made.seconds if made.seconds else 0.0
            await self._fields.set(VBAS=made.start * step, VELO=made.slew * step, ACCL=made.seconds, ACCS=slope)
            self._good = {name: self._fields[name] for name in SPEEDS}

    async def _made(self, wanted: Speeds, most: float) -> Speeds:
        """What the motor makes of speeds: no more than the largest rate, though it may round one up."""
        made = await self._motor.set_speeds(wanted)
        for number in range(TRIES):
            if not most or made.slew <= most * (1 + 1e-9):
                break
            slew = wanted.slew * (most / made.slew) ** (1 << number)  # a timer of few ticks has wide steps
            wanted = wanted._replace(start=min(wanted.start, slew), slew=slew)
            made = await self._motor.set_speeds(wanted)
        return made
