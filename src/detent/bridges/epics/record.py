"""What an EPICS motor record does, over the common face of a host driver. It knows nothing of Channel Access.

A put returns when everything that it started has ended: that is what put completion waits for. DMOV goes to 0 and
back to 1 even if there is nothing to move, and back only when all other fields are what they should be.
"""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from math import inf
from typing import Final, Protocol

from detent.bridges.epics.fields import (
    ACCL,
    ACCS,
    COMMUNICATION,
    FAILED,
    FROZEN,
    LARGEST,
    LONGEST_WAY,
    MENUS,
    NEGATIVE,
    NO_ALARM,
    RANGES,
    SET,
    STOPPED,
    Alarm,
    Doing,
    Go,
    Settings,
    Status,
    Value,
)
from detent.hosts.axis import Limits, Speeds
from detent.hosts.errors import Busy, DriverError, MotionFailed
from detent.hosts.exchange import AsyncPort

POLL: Final = 0.02  # seconds between two looks at a motor that moves
IDLE_POLL: Final = 1.0  # at one that stands
TRIES: Final = 10  # to find a rate that a unit does not round up beyond the largest one
SPEEDS: Final = ("VELO", "VBAS", "VMAX", "ACCL", "ACCS", "ACCU")


class Motor(Protocol):
    """A driver of `detent.hosts` with its asynchronous shell."""

    port: AsyncPort
    fastest: int

    async def move_to(self, position: int) -> None:
        """Begin a move to `position`."""

    async def run_at(self, rate: float) -> None:
        """Run until told otherwise."""

    async def stop(self) -> None:
        """Ramp down and stand."""

    async def home(self, direction: int) -> None:
        """Begin the search for the reference."""

    async def position(self) -> int:
        """Where the axis is, in steps."""

    async def set_position(self, position: int) -> None:
        """Call the place where the axis stands `position`."""

    async def moving(self) -> bool:
        """Whether the axis moves."""

    async def set_speeds(self, speeds: Speeds) -> Speeds:
        """Make moves so."""

    async def limits(self) -> Limits:
        """Which limit switches are met."""

    async def wait(self) -> None:
        """Wait until the axis stands. Raises MotionFailed."""


class Outlet(Protocol):
    """Where a record shows its fields."""

    async def post(self, field: str, value: Value) -> None:
        """`field` has another value."""

    async def alarm(self, alarm: Alarm) -> None:
        """The record has another alarm."""


class PutFailed(RuntimeError):
    """A put that did not do what it should have done; the text says why."""


class MotorRecord:
    """The record of `motor`. Call `begin` once, then `put` whenever a client does, and let `watch` run beside."""

    def __init__(self, motor: Motor, outlet: Outlet, settings: Settings) -> None:
        self.fields: dict[str, Value] = settings.fields()
        self._motor, self._outlet = motor, outlet
        self._alarm = NO_ALARM
        self._one = asyncio.Lock()  # one motion at a time
        self._count = 0  # of the motions that were ever wanted
        self._wanted = 0  # the number of the one that is; 0: none
        self._stop = False  # the motion under way is to end
        self._why = ""  # and its put fails for this
        self._bound: float | None = None  # the dial position that the motion under way may reach; None: it searches
        self._tuned = False  # the motor has the speeds of the fields
        self._good = {name: self.fields[name] for name in SPEEDS}  # the speeds that it took last
        self._locked = self._number("ACCS")  # the acceleration that stays, where ACCU says so
        self._raw = 0  # where the motor was seen last
        self._status = Status(0)  # what lasts: homed, a problem, no communication
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
            "SSET": lambda on: self._set(SET=1), "SUSE": lambda on: self._set(SET=0),
            **{name: self._speed(name) for name in SPEEDS},
        }  # fmt: skip

    # -- life --------------------------------------------------------------------------------------------

    async def begin(self) -> None:
        """Ask the motor where it is, give it its speeds, and show everything. Raises DriverError, ValueError.

        A unit that is busy with a program of its own is asked again by and by.
        """
        met = None
        if not self.fields["VMAX"]:
            self.fields["VMAX"] = self._good["VMAX"] = self._most
        if self._number("VMAX") > self._most * (1 + 1e-9):
            raise ValueError(f"the largest velocity {self._number('VMAX'):g}: the unit does {self._most:g} at most")
        with contextlib.suppress(Busy):
            self._raw = await self._motor.position()
            met = await self._motor.limits()
            await self._tune()
        for field, value in self.fields.items():
            await self._outlet.post(field, value)
        await self._show_limits()
        await self._show_place(met)
        await self._follow_place()

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
            self._raw = await self._motor.position()
            met = await self._motor.limits()
        except Busy:
            return  # somebody else moves it
        except (DriverError, OSError) as error:
            await self._lose(error)
            return
        await self._show_place(met)
        if self._status & Status.NO_COMMUNICATION:
            self._status &= ~Status.NO_COMMUNICATION
            self._tuned = False  # it may have been switched off meanwhile
            await self._raise(NO_ALARM)
            await self._show_status()

    def takes(self, field: str) -> bool:
        """Whether a put to `field` does more than to keep its value."""
        return field in self._puts

    async def put(self, field: str, value: Value) -> None:
        """A client puts `value`; returned is when what it starts has ended. Raises PutFailed."""
        if isinstance(self.fields.get(field), str):
            await self._set(**{field: str(value)})
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
            await self._set(**{field: int(number) if isinstance(self.fields.get(field), int) else number})

    # -- moves -------------------------------------------------------------------------------------------

    async def _put_user(self, value: float) -> None:
        if self.fields["SET"] == SET and self.fields["FOFF"] != FROZEN:
            await self._put_offset(value - self._sign * self._number("DVAL"))
            return
        await self._put_dial((value - self._number("OFF")) * self._sign)

    async def _put_raw(self, value: float) -> None:
        await self._put_dial(value * self._number("MRES"))

    async def _put_relative(self, value: float) -> None:
        await self._set(RLV=0.0)
        await self._put_user(self._number("VAL") + value)

    async def _tweak(self, on: float, direction: int) -> None:
        if on:
            await self._put_user(self._number("VAL") + direction * self._number("TWV"))

    async def _put_dial(self, value: float) -> None:
        if self.fields["SET"] == SET:
            await self._call_it(value)
            return
        self._raw_of(value)
        if self._beyond(value):
            await self._set(LVIO=1)
            await self._aim(self._number("DVAL"), again=True)
            low, high = self.fields["DLLM"], self.fields["DHLM"]
            raise PutFailed(f"dial position {value:g} is outside the limits {low:g} to {high:g}")
        if self.fields["SPMG"] == Go.STOP:
            await self._aim(self._number("DVAL"), again=True)
            self._may_move()
        await self._set(LVIO=0)
        await self._aim(value)
        self._may_move("it goes there when SPMG is Go")
        await self._move()

    def _may_move(self, then: str = "put Go to SPMG first") -> None:
        """Raise PutFailed where SPMG holds the record."""
        held = Go(self._whole("SPMG"))
        if held in (Go.STOP, Go.PAUSE):
            raise PutFailed(f"SPMG is {held.name.capitalize()}: {then}")

    def _raw_of(self, dial: float) -> int:
        """The steps of a dial position. Raises PutFailed if they are more than a record counts."""
        raw = dial / self._number("MRES")
        if not abs(raw) <= LONGEST_WAY:
            raise PutFailed(f"dial position {dial:g} is {raw:g} steps, and a motor record counts to {LONGEST_WAY}")
        return round(raw)

    async def _move(self) -> None:
        """Go where DVAL is."""
        dial = self._number("DVAL")
        target = self._raw_of(dial)
        if self._beyond(dial):  # a target that was kept while limits moved
            await self._set(LVIO=1)
            raise PutFailed(f"dial position {dial:g} is outside the limits now")
        await self._go(lambda: self._motor.move_to(target), Doing.MOVE, target - self._raw, target, bound=dial)

    async def _home(self, on: float, direction: int) -> None:
        if on:
            self._may_move()
            raw = direction * self._raw_sign
            forward = direction > 0
            await self._set(**{"HOMF" if forward else "HOMR": 1})
            try:
                doing = Doing.HOME_FORWARD if forward else Doing.HOME_REVERSE
                await self._go(lambda: self._motor.home(raw), doing, raw)
            finally:
                await self._set(HOMF=0, HOMR=0)

    async def _jog(self, on: float, direction: int) -> None:
        """Run until the put is taken back; where there are soft limits, to the limit at most."""
        field = "JOGF" if direction > 0 else "JOGR"
        if not on:
            if self.fields[field]:
                await self._put_stop(1)
            return
        self._may_move()
        dial = direction * self._sign
        end = self._number("DHLM" if dial > 0 else "DLLM") if self._limited else dial * inf
        if (end - self._number("DRBV")) * dial < abs(self._number("MRES")):
            await self._set(LVIO=1)
            raise PutFailed(f"it stands at the limit {end:g} or beyond it")
        raw = direction * self._raw_sign
        rate = abs(self._number("JVEL") / self._number("MRES"))
        # the last whole step within the limit
        target = 0 if not self._limited else self._inside(end, self._number("MRES"))
        await self._set(**{field: 1})

        async def to_the_limit() -> None:
            await self._motor.set_speeds(self._speeds()._replace(start=min(self._speeds().start, rate), slew=rate))
            self._tuned = False
            await self._motor.move_to(target)

        try:
            doing = Doing.JOG_FORWARD if direction > 0 else Doing.JOG_REVERSE
            start = to_the_limit if self._limited else lambda: self._motor.run_at(raw * rate)
            await self._go(start, doing, raw, bound=end)
        finally:
            await self._set(**{field: 0})

    async def _put_stop(self, on: float) -> None:
        """End the motion under way, if there is one."""
        if on and self._one.locked():
            self._wanted = 0  # those that wait for their turn give up, too
            self._stop = True
            async with self._one:
                pass
        await self._set(STOP=0)

    async def _put_go(self, value: float) -> None:
        before, now = self.fields["SPMG"], Go(int(value))
        await self._set(SPMG=int(now))
        if now in (Go.STOP, Go.PAUSE):
            target, moved = self._number("DVAL"), bool(self.fields["MOVN"])
            self._why = f"SPMG became {now.name.capitalize()} before it arrived"
            await self._put_stop(1)
            if now is Go.PAUSE:
                await self._aim(target)  # where to go on to
            elif moved or before == Go.PAUSE:
                await self._follow_place()
        elif before in (Go.STOP, Go.PAUSE) and self._number("DVAL") != self._number("DRBV"):
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
            if bound is not None and self._beyond(bound):
                raise PutFailed("the limits moved before it began")
            self._stop, self._why, self._bound = False, "", bound
            plus = int(direction >= 0)
            self._status &= ~(Status.PROBLEM | Status.PLUS)
            self._status |= Status.PLUS if plus else Status(0)
            await self._set(DMOV=0, MOVN=1, MIP=int(doing), MISS=0, LVIO=0, ATHM=0, TDIR=plus, CDIR=plus)
            await self._raise(NO_ALARM)
            await self._show_status()
            problem: Exception | None = None
            try:
                await self._tune()
                if target is None or target != await self._motor.position():
                    await start()
                    await self._follow()
            except (DriverError, OSError, ValueError) as error:
                problem = error
            await self._end(doing, target, problem, mine)

    async def _follow(self) -> None:
        """Show where the motor is until it stands. Raises MotionFailed if it stands elsewhere than it should."""
        motor, stopped = self._motor, False
        while await motor.moving():
            if self._stop and not stopped:
                await self._set(MIP=int(self._whole("MIP") | Doing.STOP))
                await motor.stop()
                stopped = True
            try:
                self._raw = await motor.position()
            except Busy:
                pass  # this one tells it only when it stands
            else:
                await self._show_place()
            await motor.port.wait(POLL)
        try:
            await motor.wait()
        except MotionFailed:
            if not self._stop:
                raise

    async def _end(self, doing: Doing, target: int | None, problem: Exception | None, mine: int) -> None:
        """The motor stands, or cannot be reached: show how motion `mine` ended, DMOV last. Raises PutFailed.

        What another motion takes the place of shows no end of its own.
        """
        settling = self._number("DLY")
        while settling > 0 and not self._stop:
            await self._motor.port.wait(min(settling, POLL))
            settling -= POLL
        met = None
        try:
            self._raw = await self._motor.position()
            met = await self._motor.limits()
        except (DriverError, OSError) as error:
            problem = problem or error
        else:
            self._status &= ~Status.NO_COMMUNICATION
        await self._show_place(met)
        if self._wanted not in (0, mine):
            return
        missed = target is not None and abs(target - self._raw) * abs(self._number("MRES")) > self._number("RDBD")
        if problem is None and missed and not self._stop:
            problem = MotionFailed("motor", f"stands at {self._raw} and not at {target}")
        if problem is not None and not isinstance(problem, OSError):
            self._status |= Status.PROBLEM
        if doing in (Doing.HOME_FORWARD, Doing.HOME_REVERSE) and problem is None and not self._stop:
            self._status |= Status.HOMED
            await self._set(ATHM=1)
        if target is None or self._stop or problem is not None:
            await self._follow_place()
        if problem is not None:
            await self._lose(problem)
        elif self._stop and target is not None and missed:
            await self._raise(STOPPED)
        await self._set(MISS=int(missed))
        await self._judge_place()
        if self.fields["SPMG"] == Go.MOVE:
            await self._set(SPMG=int(Go.PAUSE))
        await self._set(MOVN=0, MIP=0)
        await self._show_status(done=True)
        await self._set(DMOV=1)
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
                self._raw = await self._motor.position()
        except (DriverError, OSError, ValueError) as error:
            raise PutFailed(str(error)) from error
        dial = self._raw * self._number("MRES")
        if self.fields["FOFF"] != FROZEN:
            await self._set(OFF=self._number("VAL") - dial * self._sign)
        await self._show_place()
        await self._follow_place()
        await self._show_limits()
        await self._judge_place()

    async def _put_offset(self, value: float) -> None:
        await self._set(OFF=value)
        await self._show_place()
        await self._aim(self._number("DVAL"), again=True)
        await self._show_limits()

    async def _put_direction(self, value: float) -> None:
        user = self._number("VAL")
        await self._set(DIR=int(value))
        if self.fields["FOFF"] == FROZEN:
            await self._put_offset(self._number("OFF"))
        else:
            await self._put_offset(user - self._sign * self._number("DVAL"))

    async def _put_resolution(self, value: float) -> None:
        """Another MRES. Rates and limits stay what they are in steps, as in motor records since R7-3."""
        if abs(value) < 1 / LARGEST:
            raise PutFailed("a resolution of 0 is no resolution")
        if self.fields["MOVN"]:
            raise PutFailed("it moves: stop it first")
        ratio = abs(value / self._number("MRES"))
        speeds = {name: self._number(name) * ratio for name in ("VELO", "VBAS", "VMAX", "ACCS", "JVEL")}
        low, high = sorted(self._number(name) * value for name in ("RLLM", "RHLM"))
        self._locked *= ratio
        self._good |= {name: speeds[name] for name in SPEEDS if name in speeds}
        await self._set(MRES=value, RRES=value, ERES=value, UREV=abs(value) * self._number("SREV"), **speeds)
        await self._set(DLLM=low, DHLM=high)
        await self._show_limits()
        await self._show_place()
        await self._follow_place()
        await self._judge_place()

    async def _put_limit(self, value: float, *, high: bool) -> None:
        """A user limit is the other dial limit where the directions differ."""
        dial = (value - self._number("OFF")) * self._sign
        await self._put_limits(**{"high" if high == (self._sign > 0) else "low": dial})

    async def _put_raw_limit(self, value: float, *, high: bool) -> None:
        dial = value * self._number("MRES")
        await self._put_limits(**{"high" if high == (self._number("MRES") > 0) else "low": dial})

    async def _put_limits(self, low: float | None = None, high: float | None = None) -> None:
        """Another dial limit. A motion that would go beyond it is stopped, and its put fails."""
        low = self._number("DLLM") if low is None else low
        high = self._number("DHLM") if high is None else high
        if low > high:
            raise PutFailed(f"the low limit {low:g} lies above the high limit {high:g}: put that one first")
        await self._set(DLLM=low, DHLM=high)
        await self._show_limits()
        if self.fields["MOVN"] and self._bound is not None and not self._stop:
            over = self._beyond(self._bound)
            await self._set(LVIO=int(over))
            if over:
                self._why = "the limits moved, and where it was to go lies beyond them"
                self._wanted = 0
                self._stop = True
        else:
            await self._judge_place()

    async def _judge_place(self) -> None:
        """LVIO is whether the axis stands beyond a limit, by more than a step."""
        here, step = self._number("DRBV"), abs(self._number("MRES"))
        low, high = self._number("DLLM"), self._number("DHLM")
        await self._set(LVIO=int(self._limited and not low - step <= here <= high + step))

    async def _show_limits(self) -> None:
        low, high = self._number("DLLM"), self._number("DHLM")
        raw = sorted(end / self._number("MRES") for end in (low, high))
        user = sorted(self._user(end) for end in (low, high))
        await self._set(HLM=user[1], LLM=user[0], RHLM=raw[1], RLLM=raw[0])

    def _speed(self, field: str) -> Callable[[float], Awaitable[None]]:
        """What a put to one of `SPEEDS` does. If the unit refuses it, all are what they were."""

        async def put(value: float) -> None:
            old = {name: self.fields[name] for name in SPEEDS}
            locked = self._locked
            await self._set(**self._with_speed(field, value))
            self._tuned = False
            if self.fields["MOVN"]:
                return  # the next motion has it
            async with self._one:
                try:
                    await self._tune()
                except (DriverError, OSError, ValueError) as error:
                    self._tuned, self._locked = False, locked
                    await self._set(**old)
                    raise PutFailed(str(error)) from error

        return put

    def _with_speed(self, field: str, value: float) -> dict[str, Value]:
        """All of `SPEEDS` after a put: velocities within VBAS and VMAX, and one acceleration, of two that are kept."""
        new = {name: self._number(name) for name in SPEEDS} | {field: value}
        if field in ("ACCL", "ACCS"):
            new["ACCU"] = ACCS if field == "ACCS" else ACCL
        if (field in ("ACCS", "VMAX", "VELO", "VBAS") and not value >= 0) or (field == "ACCS" and not value):
            raise PutFailed(f"{value:g} is too little")
        most = self._most
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
    def _most(self) -> float:
        """The largest rate of the unit in units/s."""
        return self._motor.fastest * abs(self._number("MRES"))

    def _speeds(self) -> Speeds:
        step = abs(self._number("MRES"))
        return Speeds(self._number("VBAS") / step, self._number("VELO") / step, self._number("ACCL"))

    async def _tune(self) -> None:
        """Give the motor its speeds, and show what it makes of them."""
        if not self._tuned:
            step = abs(self._number("MRES"))
            try:
                made = await self._made(self._speeds(), self._number("VMAX") / step)
            except ValueError:
                await self._set(**self._good)  # what it cannot do does not stay
                raise
            self._tuned = True
            slope = made.slew * step / made.seconds if made.seconds else 0.0
            await self._set(VBAS=made.start * step, VELO=made.slew * step, ACCL=made.seconds, ACCS=slope)
            self._good = {name: self.fields[name] for name in SPEEDS}

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

    async def _put_sync(self, on: float) -> None:
        """Where the motor is, is where it should be."""
        if on:
            async with self._one:
                await self.look()
            await self._follow_place()
            self._status &= ~Status.PROBLEM
            if not self._status & Status.NO_COMMUNICATION:
                await self._raise(NO_ALARM)
            await self._set(MISS=0, LVIO=0)
            await self._show_status(done=True)
        await self._set(SYNC=0)

    async def _put_status(self, on: float) -> None:
        if on and not self._one.locked():
            async with self._one:
                await self.look()
        await self._set(STUP=0)

    # -- what is shown -----------------------------------------------------------------------------------

    @property
    def _sign(self) -> int:
        """Of user over dial."""
        return -1 if self.fields["DIR"] == NEGATIVE else 1

    @property
    def _raw_sign(self) -> int:
        """Of raw over user."""
        return self._sign if self._number("MRES") > 0 else -self._sign

    def _number(self, field: str) -> float:
        value = self.fields[field]
        assert not isinstance(value, str)
        return value

    def _user(self, dial: float) -> float:
        return dial * self._sign + self._number("OFF")

    def _whole(self, field: str) -> int:
        return int(self._number(field))

    @property
    def _limited(self) -> bool:
        """Both limits at 0 are none."""
        return bool(self.fields["DLLM"] or self.fields["DHLM"])

    def _beyond(self, dial: float) -> bool:
        """Whether it is outside the limits, by more than a number that is written in digits may differ from one."""
        low, high = self._number("DLLM"), self._number("DHLM")
        slack = abs(self._number("MRES")) * 1e-6
        return self._limited and not low - slack <= dial <= high + slack

    def _inside(self, limit: float, step: float) -> int:
        """The last whole step that is not beyond the limit, high or low."""
        raw = round(limit / step)
        inwards = 1 if (limit == self._number("DLLM")) == (step > 0) else -1
        return raw + inwards if self._beyond(raw * step) else raw

    async def _set(self, **values: Value) -> None:
        for field, value in values.items():
            if self.fields.get(field) != value:
                self.fields[field] = value
                await self._outlet.post(field, value)

    async def _aim(self, dial: float, *, again: bool = False) -> None:
        """The target is `dial`; with `again` VAL and its like are shown even if they are no news to the record."""
        raw = round(dial / self._number("MRES"))
        if again:
            for field in ("VAL", "DVAL", "RVAL"):
                self.fields.pop(field)
        await self._set(VAL=self._user(dial), DVAL=dial, RVAL=raw)
        await self._show_difference()

    async def _follow_place(self) -> None:
        """The target is where the motor is."""
        await self._aim(self._raw * self._number("MRES"), again=True)

    async def _show_place(self, met: Limits | None = None) -> None:
        """Show the readback and, where they are known, the limit switches."""
        dial = self._raw * self._number("MRES")
        await self._set(RRBV=self._raw, RMP=self._raw, REP=self._raw, DRBV=dial, RBV=self._user(dial))
        await self._show_difference()
        if met is not None:
            low, high = int(met.low or False), int(met.high or False)
            await self._set(RHLS=high, RLLS=low)
            if self._raw_sign < 0:
                low, high = high, low
            await self._set(HLS=high, LLS=low)
            await self._show_status(done=not self.fields["MOVN"])

    async def _show_difference(self) -> None:
        difference = self._number("DVAL") - self._number("DRBV")
        await self._set(DIFF=difference, RDIF=round(difference / self._number("MRES")))

    async def _show_status(self, *, done: bool = False) -> None:
        status = self._status | (Status.DONE if done else Status.MOVING)
        status |= Status.PLUS_LIMIT if self.fields["RHLS"] else Status(0)
        status |= Status.MINUS_LIMIT if self.fields["RLLS"] else Status(0)
        await self._set(MSTA=int(status))

    async def _raise(self, alarm: Alarm) -> None:
        if alarm != self._alarm:
            self._alarm = alarm
            await self._outlet.alarm(alarm)

    async def _lose(self, error: Exception) -> None:
        """Something went wrong: raise the alarm that says of which kind."""
        if isinstance(error, OSError):  # NoAnswer and PortLost are such
            self._status |= Status.NO_COMMUNICATION
            await self._raise(COMMUNICATION)
        else:
            await self._raise(FAILED)
        await self._show_status(done=True)
