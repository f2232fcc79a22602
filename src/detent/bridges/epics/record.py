"""What an EPICS motor record does, over the common face of a host driver. It knows nothing of Channel Access.

A put returns when everything that it started has ended: that is what put completion waits for. DMOV goes to 0 and
back to 1 even if there is nothing to move, and back only when all other fields are what they should be.
"""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from math import inf
from typing import Final

from detent.bridges.epics.fields import (
    FROZEN,
    LARGEST,
    LONGEST_WAY,
    MENUS,
    NO_ALARM,
    RANGES,
    SET,
    STOPPED,
    Doing,
    Go,
    Settings,
    Status,
    Value,
)
from detent.bridges.epics.motor import Motor, Outlet, PutFailed
from detent.bridges.epics.record_fields import RecordFields
from detent.bridges.epics.speed_fields import SPEEDS, SpeedFields
from detent.hosts.errors import Busy, DriverError, MotionFailed

POLL: Final = 0.02  # seconds between two looks at a motor that moves
IDLE_POLL: Final = 1.0  # at one that stands


class MotorRecord:
    """The record of `motor`. Call `begin` once, then `put` whenever a client does, and let `watch` run beside."""

    def __init__(self, motor: Motor, outlet: Outlet, settings: Settings) -> None:
        self._motor = motor
        self._fields = RecordFields(settings, outlet)
        self._one = asyncio.Lock()  # one motion at a time
        self._speeds = SpeedFields(self._fields, motor, self._one)
        self._count = 0  # of the motions that were ever wanted
        self._wanted = 0  # the number of the one that is; 0: none
        self._ending = asyncio.Event()  # the motion under way is to end
        self._stood = 0  # how many motions were seen to end
        self._why = ""  # and its put fails for this
        self._bound: float | None = None  # the dial position that the motion under way may reach; None: it searches
        self._puts: dict[str, Callable[[float], Awaitable[None]]] = {
            "VAL": self._put_user, "DVAL": self._put_dial, "RVAL": self._put_raw, "RLV": self._put_relative,
            "TWF": lambda on: self._tweak(on, +1), "TWR": lambda on: self._tweak(on, -1),
            "HOMF": lambda on: self._home(on, +1), "HOMR": lambda on: self._home(on, -1),
            "JOGF": lambda on: self._jog(on, +1), "JOGR": lambda on: self._jog(on, -1),
            "STOP": self._put_stop, "SPMG": self._put_go, "SYNC": self._put_sync, "STUP": self._put_status,
            "HLM": lambda to: self._put_limit(to, high=True), "LLM": lambda to: self._put_limit(to, high=False),
            "DHLM": lambda to: self._put_limits(high=to), "DLLM": lambda to: self._put_limits(low=to),
            "RHLM": lambda to: self._put_raw_limit(to, high=True),
            "RLLM": lambda to: self._put_raw_limit(to, high=False),
            "OFF": self._put_offset, "DIR": self._put_direction, "MRES": self._put_resolution,
            "SSET": lambda on: self._fields.set(SET=1), "SUSE": lambda on: self._fields.set(SET=0),
            **{name: partial(self._speeds.put, name) for name in SPEEDS},
        }  # fmt: skip

    @property
    def _stop(self) -> bool:
        return self._ending.is_set()

    @_stop.setter
    def _stop(self, on: bool) -> None:
        (self._ending.set if on else self._ending.clear)()

    @property
    def fields(self) -> Mapping[str, Value]:
        """What its fields are."""
        return self._fields.values

    # -- life --------------------------------------------------------------------------------------------

    async def begin(self) -> None:
        """Ask the motor where it is, give it its speeds, and show everything. Raises DriverError, ValueError.

        A unit that is busy with a program of its own is asked again by and by.
        """
        met = None
        await self._speeds.begin()
        with contextlib.suppress(Busy):
            self._fields.raw = await self._motor.position()
            met = await self._motor.limits()
            await self._speeds.tune()
        await self._fields.show_all()
        await self._fields.show_limits()
        await self._fields.show_place(met)
        await self._fields.follow_place()

    async def watch(self) -> None:
        """Look at the motor now and then, for ever: switches, a hand at the shaft, a cable that is out."""
        while True:
            await self._motor.port.wait(IDLE_POLL)
            if not self._one.locked():
                async with self._one:
                    await self.look()

    async def look(self) -> None:
        """See where the motor is. Without an answer the record has a COMM alarm, until there is one again."""
        try:
            self._fields.raw = await self._motor.position()
            met = await self._motor.limits()
        except Busy:
            return  # somebody else moves it
        except (DriverError, OSError) as error:
            await self._fields.lose(error)
            return
        await self._fields.show_place(met)
        if self._fields.status & Status.NO_COMMUNICATION:
            self._fields.status &= ~Status.NO_COMMUNICATION
            self._speeds.forget()  # it may have been switched off meanwhile
            await self._fields.alarm(NO_ALARM)
            await self._fields.show_status()

    def takes(self, field: str) -> bool:
        """Whether a put to `field` does more than to keep its value."""
        return field in self._puts

    async def put(self, field: str, value: Value) -> None:
        """A client puts `value`; returned is when what it starts has ended. Raises PutFailed."""
        if isinstance(self.fields.get(field), str):
            await self._fields.set(**{field: str(value)})
            return
        try:
            number = float(value)
        except (ValueError, OverflowError):
            raise PutFailed(f"{value!r} is no number") from None
        if not abs(number) <= LARGEST:
            raise PutFailed(f"{number:g} is no number that a field can have")
        if field in MENUS and (number not in range(MENUS[field])):
            raise PutFailed(f"{number:g} is none of its choices, 0 to {MENUS[field] - 1}")
        low, high = RANGES.get(field, (-LARGEST, LARGEST))
        if not low <= number <= high:
            raise PutFailed(f"{number:g} is outside {low:g} to {high:g}")
        if field in self._puts:
            await self._puts[field](number)
        else:
            await self._fields.set(**{field: int(number) if isinstance(self.fields.get(field), int) else number})

    # -- moves -------------------------------------------------------------------------------------------

    async def _put_user(self, value: float) -> None:
        if self._fields["SET"] == SET and self._fields["FOFF"] != FROZEN:
            await self._put_offset(value - self._fields.sign * self._fields.number("DVAL"))
            return
        await self._put_dial((value - self._fields.number("OFF")) * self._fields.sign)

    async def _put_raw(self, value: float) -> None:
        await self._put_dial(value * self._fields.number("MRES"))

    async def _put_relative(self, value: float) -> None:
        await self._fields.set(RLV=0.0)
        await self._put_user(self._fields.number("VAL") + value)

    async def _tweak(self, on: float, direction: int) -> None:
        if on:
            await self._put_user(self._fields.number("VAL") + direction * self._fields.number("TWV"))

    async def _put_dial(self, value: float) -> None:
        if self._fields["SET"] == SET:
            await self._call_it(value)
            return
        self._raw_of(value)
        if self._fields.beyond(value):
            await self._fields.set(LVIO=1)
            await self._fields.aim(self._fields.number("DVAL"), again=True)
            low, high = self._fields["DLLM"], self._fields["DHLM"]
            raise PutFailed(f"dial position {value:g} is outside the limits {low:g} to {high:g}")
        if self._fields["SPMG"] == Go.STOP:
            await self._fields.aim(self._fields.number("DVAL"), again=True)
            self._may_move()
        await self._fields.set(LVIO=0)
        await self._fields.aim(value)
        self._may_move("it goes there when SPMG is Go")
        await self._move()

    def _may_move(self, then: str = "put Go to SPMG first") -> None:
        """Raise PutFailed where SPMG holds the record."""
        held = Go(self._fields.whole("SPMG"))
        if held in (Go.STOP, Go.PAUSE):
            raise PutFailed(f"SPMG is {held.name.capitalize()}: {then}")

    def _raw_of(self, dial: float) -> int:
        """The steps of a dial position. Raises PutFailed if they are more than a record counts."""
        raw = dial / self._fields.number("MRES")
        if not abs(raw) <= LONGEST_WAY:
            raise PutFailed(f"dial position {dial:g} is {raw:g} steps, and a motor record counts to {LONGEST_WAY}")
        return round(raw)

    async def _move(self) -> None:
        """Go where DVAL is."""
        dial = self._fields.number("DVAL")
        target = self._raw_of(dial)
        if self._fields.beyond(dial):  # a target that was kept while limits moved
            await self._fields.set(LVIO=1)
            raise PutFailed(f"dial position {dial:g} is outside the limits now")
        await self._go(lambda: self._motor.move_to(target), Doing.MOVE, target - self._fields.raw, target, bound=dial)

    async def _home(self, on: float, direction: int) -> None:
        if on:
            self._may_move()
            raw = direction * self._fields.raw_sign
            forward = direction > 0
            await self._fields.set(**{"HOMF" if forward else "HOMR": 1})
            try:
                doing = Doing.HOME_FORWARD if forward else Doing.HOME_REVERSE
                await self._go(lambda: self._motor.home(raw), doing, raw)
            finally:
                await self._fields.set(HOMF=0, HOMR=0)

    async def _jog(self, on: float, direction: int) -> None:
        """Run until the put is taken back; where there are soft limits, to the limit at most."""
        field = "JOGF" if direction > 0 else "JOGR"
        if not on:
            if self._fields[field]:
                await self._put_stop(1)
            return
        self._may_move()
        dial = direction * self._fields.sign
        end = self._fields.number("DHLM" if dial > 0 else "DLLM") if self._fields.limited else dial * inf
        if (end - self._fields.number("DRBV")) * dial < abs(self._fields.number("MRES")):
            await self._fields.set(LVIO=1)
            raise PutFailed(f"it stands at the limit {end:g} or beyond it")
        raw = direction * self._fields.raw_sign
        rate = abs(self._fields.number("JVEL") / self._fields.number("MRES"))
        # the last whole step within the limit
        target = 0 if not self._fields.limited else self._fields.inside(end, self._fields.number("MRES"))
        await self._fields.set(**{field: 1})

        async def to_the_limit() -> None:
            asked = self._speeds.asked()
            await self._motor.set_speeds(asked._replace(start=min(asked.start, rate), slew=rate))
            self._speeds.forget()
            await self._motor.move_to(target)

        try:
            doing = Doing.JOG_FORWARD if direction > 0 else Doing.JOG_REVERSE
            start = to_the_limit if self._fields.limited else lambda: self._motor.run_at(raw * rate)
            await self._go(start, doing, raw, bound=end)
        finally:
            await self._fields.set(**{field: 0})

    async def _put_stop(self, on: float) -> None:
        """End the motion under way, whoever has begun it. Raises PutFailed."""
        if on:
            stood = self._stood
            self._wanted = 0  # those that wait for their turn give up, too
            self._stop = True
            try:
                async with self._one:
                    if self._stood == stood:
                        await self._end_what_others_began()
            finally:
                await self._fields.set(STOP=0)
        else:
            await self._fields.set(STOP=0)

    async def _end_what_others_began(self) -> None:
        """Stop the motor, whether it moves or not: another host may move it, or a call that seemed to have failed."""
        try:
            await self._motor.stop()
            with contextlib.suppress(MotionFailed):
                while await self._motor.moving():
                    await self._motor.port.wait(POLL)
        except (DriverError, OSError) as error:
            await self._fields.lose(error)
            raise PutFailed(str(error)) from error
        before = self._fields.raw
        await self.look()
        if self._fields.raw != before:
            await self._fields.follow_place()

    async def _put_go(self, value: float) -> None:
        before, now = self._fields["SPMG"], Go(int(value))
        await self._fields.set(SPMG=int(now))
        if now in (Go.STOP, Go.PAUSE):
            target, moved = self._fields.number("DVAL"), bool(self._fields["MOVN"])
            self._why = f"SPMG became {now.name.capitalize()} before it arrived"
            await self._put_stop(1)
            if now is Go.PAUSE:
                await self._fields.aim(target)  # where to go on to
            elif moved or before == Go.PAUSE:
                await self._fields.follow_place()
        elif before in (Go.STOP, Go.PAUSE) and self._fields.number("DVAL") != self._fields.number("DRBV"):
            await self._move()

    async def _go(
        self,
        start: Callable[[], Awaitable[None]],
        doing: Doing,
        direction: int,
        target: int | None = None,
        bound: float | None = None,
    ) -> None:
        """Carry out one motion in place of another that is under way. Raises PutFailed if it did not end as asked."""
        self._count += 1
        self._wanted = mine = self._count
        if self._one.locked():
            self._stop = True
        async with self._one:
            if mine != self._wanted:
                if not self._wanted and self._why:
                    raise PutFailed(self._why)
                return  # something newer came while this waited
            if bound is not None and self._fields.beyond(bound):
                raise PutFailed("the limits moved before it began")
            self._stop, self._why, self._bound = False, "", bound
            plus = int(direction >= 0)
            self._fields.status &= ~(Status.PROBLEM | Status.PLUS)
            self._fields.status |= Status.PLUS if plus else Status(0)
            await self._fields.set(DMOV=0, MOVN=1, MIP=int(doing), MISS=0, LVIO=0, ATHM=0, TDIR=plus, CDIR=plus)
            await self._fields.alarm(NO_ALARM)
            await self._fields.show_status()
            problem: Exception | None = None
            try:
                if await self._begun(start, target):
                    await self._follow()
            except (DriverError, OSError, ValueError) as error:
                problem = error
            await self._end(doing, target, problem, mine)

    async def _begun(self, start: Callable[[], Awaitable[None]], target: int | None) -> bool:
        """Begin a motion; whether the motor may move. A stop breaks this off.

        A unit may let a move wait for one that another host has begun, which may never end.
        """

        async def begins() -> bool:
            await self._speeds.tune()
            if target is not None and target == await self._motor.position() and not await self._motor.moving():
                return False
            await start()
            return True

        beginning, ending = asyncio.ensure_future(begins()), asyncio.ensure_future(self._ending.wait())
        try:
            await asyncio.wait({beginning, ending}, return_when=asyncio.FIRST_COMPLETED)
            if beginning.done():
                return beginning.result()
            beginning.cancel()
            await asyncio.wait({beginning})
            if not beginning.cancelled() and (error := beginning.exception()) is not None:
                raise error
            await self._motor.stop()
            return True
        finally:
            beginning.cancel()
            ending.cancel()

    async def _follow(self) -> None:
        """Show where the motor is until it stands. Raises MotionFailed if it stands elsewhere than it should."""
        motor, stopped = self._motor, False
        while await motor.moving():
            if self._stop and not stopped:
                await self._fields.set(MIP=int(self._fields.whole("MIP") | Doing.STOP))
                await motor.stop()
                stopped = True
            try:
                self._fields.raw = await motor.position()
            except Busy:
                pass  # this one tells it only when it stands
            else:
                await self._fields.show_place()
            await motor.port.wait(POLL)
        self._stood += 1
        try:
            await motor.wait()
        except MotionFailed:
            if not self._stop:
                raise

    async def _end(self, doing: Doing, target: int | None, problem: Exception | None, mine: int) -> None:
        """The motor stands, or cannot be reached: show how motion `mine` ended, DMOV last. Raises PutFailed.

        What another motion takes the place of shows no end of its own.
        """
        settling = self._fields.number("DLY")
        while settling > 0 and not self._stop:
            await self._motor.port.wait(min(settling, POLL))
            settling -= POLL
        met = None
        try:
            self._fields.raw = await self._motor.position()
            met = await self._motor.limits()
        except (DriverError, OSError) as error:
            problem = problem or error
        else:
            self._fields.status &= ~Status.NO_COMMUNICATION
        await self._fields.show_place(met)
        if self._wanted not in (0, mine):
            return
        off = 0 if target is None else abs(target - self._fields.raw) * abs(self._fields.number("MRES"))
        missed = target is not None and off > self._fields.number("RDBD")
        if problem is None and missed and not self._stop:
            problem = MotionFailed("motor", f"stands at {self._fields.raw} and not at {target}")
        if problem is not None and not isinstance(problem, OSError):
            self._fields.status |= Status.PROBLEM
        if doing in (Doing.HOME_FORWARD, Doing.HOME_REVERSE) and problem is None and not self._stop:
            self._fields.status |= Status.HOMED
            await self._fields.set(ATHM=1)
        if target is None or self._stop or problem is not None:
            await self._fields.follow_place()
        if problem is not None:
            await self._fields.lose(problem)
        elif self._stop and target is not None and missed:
            await self._fields.alarm(STOPPED)
        await self._fields.set(MISS=int(missed))
        await self._fields.judge_place()
        if self._fields["SPMG"] == Go.MOVE:
            await self._fields.set(SPMG=int(Go.PAUSE))
        await self._fields.set(MOVN=0, MIP=0)
        await self._fields.show_status(done=True)
        await self._fields.set(DMOV=1)
        if problem is not None:
            raise PutFailed(str(problem))
        if self._stop and self._why and (missed or target is None):
            raise PutFailed(self._why)

    # -- settings ----------------------------------------------------------------------------------------

    async def _call_it(self, dial: float) -> None:
        """SET: the place where the motor stands is `dial` from now on. With a variable offset VAL stays what it is."""
        raw = self._raw_of(dial)
        try:
            async with self._one:
                await self._motor.set_position(raw)
                self._fields.raw = await self._motor.position()
        except (DriverError, OSError, ValueError) as error:
            raise PutFailed(str(error)) from error
        dial = self._fields.raw * self._fields.number("MRES")
        if self._fields["FOFF"] != FROZEN:
            await self._fields.set(OFF=self._fields.number("VAL") - dial * self._fields.sign)
        await self._fields.show_place()
        await self._fields.follow_place()
        await self._fields.show_limits()
        await self._fields.judge_place()

    async def _put_offset(self, value: float) -> None:
        await self._fields.set(OFF=value)
        await self._fields.show_place()
        await self._fields.aim(self._fields.number("DVAL"), again=True)
        await self._fields.show_limits()

    async def _put_direction(self, value: float) -> None:
        user = self._fields.number("VAL")
        await self._fields.set(DIR=int(value))
        if self._fields["FOFF"] == FROZEN:
            await self._put_offset(self._fields.number("OFF"))
        else:
            await self._put_offset(user - self._fields.sign * self._fields.number("DVAL"))

    async def _put_resolution(self, value: float) -> None:
        """Another MRES. Rates and limits stay what they are in steps, as in motor records since R7-3."""
        if abs(value) < 1 / LARGEST:
            raise PutFailed("a resolution of 0 is no resolution")
        if self._fields["MOVN"]:
            raise PutFailed("it moves: stop it first")
        ratio = abs(value / self._fields.number("MRES"))
        speeds = self._speeds.scale(ratio) | {"JVEL": self._fields.number("JVEL") * ratio}
        low, high = sorted(self._fields.number(name) * value for name in ("RLLM", "RHLM"))
        await self._fields.set(
            MRES=value, RRES=value, ERES=value, UREV=abs(value) * self._fields.number("SREV"), **speeds
        )
        await self._fields.set(DLLM=low, DHLM=high)
        await self._fields.show_limits()
        await self._fields.show_place()
        await self._fields.follow_place()
        await self._fields.judge_place()

    async def _put_limit(self, value: float, *, high: bool) -> None:
        """A user limit is the other dial limit where the directions differ."""
        dial = (value - self._fields.number("OFF")) * self._fields.sign
        await self._put_limits(**{"high" if high == (self._fields.sign > 0) else "low": dial})

    async def _put_raw_limit(self, value: float, *, high: bool) -> None:
        dial = value * self._fields.number("MRES")
        await self._put_limits(**{"high" if high == (self._fields.number("MRES") > 0) else "low": dial})

    async def _put_limits(self, low: float | None = None, high: float | None = None) -> None:
        """Another dial limit. A motion that would go beyond it is stopped, and its put fails."""
        low = self._fields.number("DLLM") if low is None else low
        high = self._fields.number("DHLM") if high is None else high
        if low > high:
            raise PutFailed(f"the low limit {low:g} lies above the high limit {high:g}: put that one first")
        await self._fields.set(DLLM=low, DHLM=high)
        await self._fields.show_limits()
        if self._fields["MOVN"] and self._bound is not None and not self._stop:
            over = self._fields.beyond(self._bound)
            await self._fields.set(LVIO=int(over))
            if over:
                self._why = "the limits moved, and where it was to go lies beyond them"
                self._wanted = 0
                self._stop = True
        else:
            await self._fields.judge_place()

    async def _put_sync(self, on: float) -> None:
        """Where the motor is, is where it should be."""
        if on:
            async with self._one:
                await self.look()
            await self._fields.follow_place()
            self._fields.status &= ~Status.PROBLEM
            if not self._fields.status & Status.NO_COMMUNICATION:
                await self._fields.alarm(NO_ALARM)
            await self._fields.set(MISS=0, LVIO=0)
            await self._fields.show_status(done=True)
        await self._fields.set(SYNC=0)

    async def _put_status(self, on: float) -> None:
        if on and not self._one.locked():
            async with self._one:
                await self.look()
        await self._fields.set(STUP=0)
