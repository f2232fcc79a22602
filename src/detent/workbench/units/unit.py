"""A unit that the workbench talks to: what it told last, one job at a time, and a stop that is before everything."""

import asyncio
import contextlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, TypeVar

from detent.controllers import catalogue
from detent.controllers.gsc200.pins import select
from detent.controllers.phrase import Phrases
from detent.hosts.axis import Axis
from detent.hosts.dcb274 import Dcb274
from detent.hosts.errors import BadAnswer, DriverError, Refused, told
from detent.hosts.exchange import Asynchronous, Progress, Steps
from detent.hosts.genstepper import GenStepper
from detent.hosts.typed import Said, say
from detent.pins import HIGH, LOW, Level
from detent.realtime.connect import connect_async, host
from detent.workbench.live import Value
from detent.workbench.stopping import StopFailed
from detent.workbench.stops import UNITS, Overtaken, Stops
from detent.workbench.units.asked import Look, look
from detent.workbench.units.manual import ManualMoves, check_moves, manual_moves
from detent.workbench.units.manual import run as run_at
from detent.workbench.units.party import Party, Turn
from detent.workbench.units.tap import Tap
from detent.workbench.units.transcript import Transcript

T = TypeVar("T")

WATCH: Final = 0.1  # seconds between two looks whether the port is there
RATES: Final = (0.2, 0.5, 1.0, 2.0, 5.0)  # looks a second that one may choose
RATE: Final = 1.0
SLOWEST: Final = 8.0  # seconds between two looks at a unit that does not answer
RAMP_SECONDS: Final = 2.0  # that a unit has to take its stop command, before it is stopped at once
DEAF_SECONDS: Final = 7.0  # the same for a DCB-274, which takes no line while it ramps down out of a program
HALT_SECONDS: Final = 5.0  # and for that one
LOOK_SECONDS: Final = 0.3  # that a look under way may still take when a stop comes: one takes 0.1 s at 9600 baud
HOLD_SECONDS: Final = 1.0  # a key is let go if its window has not said for so long that it is held
CHOICES: Final = ("X", "Y", "B")  # of the motors of a GenStepper board
FORM: Final = ("baud", "data_bits", "stop_bits")
WHOLE: Final = (*FORM, "address", "drive")  # options that are whole numbers
NOT_ALIVE: Final = "the port is gone ({}): mend the cable, then connect again; nothing was sent since"


class UnitBusy(RuntimeError):
    """Something else is done with the unit. The text says what, and what to do."""


def options_of(text: str) -> dict[str, Any]:
    """Options as people write them: ``name=X mode=party baud=4800 checksums=no``. Raises ValueError."""
    found: dict[str, Any] = {}
    for word in text.split():
        name, equals, value = word.partition("=")
        name = name.strip("-").replace("-", "_")
        if not equals or not value:
            raise ValueError(f"{word!r}: write options like name=X mode=party baud=4800 checksums=no")
        try:
            found[name] = int(value) if name in WHOLE else float(value) if name == "patience" else value
        except ValueError:
            raise ValueError(f"{word!r}: {name} takes a number") from None
        if name == "checksums":
            found[name] = value.lower() in ("yes", "true", "1", "high")
    if "name" in found and "mode" not in found:
        found["mode"] = "party"  # in single mode an axis needs no name
    return found


class Unit:
    """A unit at a port. Make it with `open`; nothing is sent before `begin`.

    One job at a time; looks come between. `stop` breaks off whatever is done. A port that is lost is told at once, and
    nothing is sent until `connect`.
    """

    @classmethod
    async def open(
        cls,
        name: str,
        model: str,
        address: str,
        options: Mapping[str, Any],
        told: Callable[["Unit"], None],
        stops: Stops,
        beside: "Unit | None" = None,
    ) -> "Unit":
        """The unit of `model` at `address`, as `connect` takes both. `told` is called when `facts` have changed.

        Nothing is done with it that was asked before its last of `stops`. `beside`: a unit on the same line, whose port
        they share. Raises ValueError, PortError.
        """  # fmt: skip
        unit = cls(name, model, address, told, stops)
        port = address if beside is None else beside.tap.port
        shell = await connect_async(model, port, watch=unit._watch, **options)
        transcript = Transcript(phrases(model, options), numbers=model == "supersigma")
        unit.tap = Tap(shell.port, transcript, None if beside is None else beside.tap)
        if beside is not None:
            unit.party = beside.party
        unit.party.units.append(unit)
        shell.port = unit.tap
        unit.shell = shell
        unit.written = " ".join(f"{key}={value}" for key, value in options.items())
        unit.manual = manual_moves(shell.driver)
        return unit

    shell: Asynchronous
    tap: Tap
    manual: ManualMoves

    def __init__(
        self, name: str, model: str, address: str, told: Callable[["Unit"], None], stops: Stops
    ) -> None:  # fmt: skip
        """Use `open`."""
        self.name, self.model, self.address, self._told, self._stops = name, model, address, told, stops
        self.party: Party[Unit] = Party()
        self.written = ""  # its options
        self.paused = False
        self.rate = RATE
        self.seen: Look | None = None  # what it told last, None: nothing that is known
        self.last: int | None = None  # the position that it told last
        self.trouble = ""  # why it does not tell
        self.job = ""  # what is done with it
        self.progress: tuple[int, int, str] = (0, 0, "")
        self.outcome = ""  # what came of the last stop
        self.took = 0.0  # seconds of the last look
        self._looking: asyncio.Task[Look] | None = None
        self._doing: asyncio.Task[Any] | None = None
        self._stopping: asyncio.Task[str] | None = None
        self._loop: asyncio.Task[None] | None = None
        self._guard: asyncio.Task[None] | None = None  # kept while a key is held
        self._failures = 0
        self._held_until = 0.0  # by the clock of the event loop; 0: no key is held
        self._closed = False

    # -- being there -------------------------------------------------------------------------------------

    def begin(self) -> None:
        """Look at it from now on."""
        self._loop = asyncio.create_task(self._look_on())

    async def connect(self) -> None:
        """After the port was lost, or the unit has not answered: look again. Raises OSError."""
        if self.tap.lost:
            self.shell.driver.forget()
            self.tap.renew()
            await self.tap.look()
        self._failures, self.trouble, self.paused = 0, "", False
        self._tell()

    async def close(self) -> None:
        """Let go of it, and of its port unless others share it. A key that is held is let go; else nothing is sent."""
        if self._held_until:
            with contextlib.suppress(StopFailed):
                await self.stop()
        self._closed = True
        await self._break_off()
        if self._loop is not None:
            self._loop.cancel()
        self.party.units.remove(self)
        if not self.party.units:
            await self.tap.close()

    @property
    def facts(self) -> dict[str, Value]:
        """Everything that windows show of it."""
        seen = self.seen
        manual = self.manual
        return {
            "model": self.model, "axis": getattr(self.shell.driver, "motor", ""), "address": self.address,
            "options": self.written, "lost": self.tap.lost, "trouble": self.trouble,
            "state": seen.state if seen else None, "moving": seen.moving if seen else None,
            "position": seen.position if seen else None, "last": self.last, "rate": seen.rate if seen else None,
            "facts": [list(fact) for fact in seen.facts] if seen else [], "paused": self.paused, "asking": self.rate,
            "took": round(self.took, 4), "job": self.job, "progress": list(self.progress), "outcome": self.outcome,
            "stopping": self._stopping is not None, "held": self._held_until > 0, "can": manual._asdict(),
            "talk": self.tap.transcript.count,
        }  # fmt: skip

    # -- jobs --------------------------------------------------------------------------------------------

    async def perform(self, what: str, steps: Steps[T]) -> T:
        """Carry out an operation of the plain driver. It goes on if who asked for it goes away; `stop` breaks it off.

        Raises UnitBusy, Overtaken, DriverError, ValueError.
        """
        self._stops.check(UNITS, self.name)
        if self.tap.lost:
            raise UnitBusy(NOT_ALIVE.format(self.tap.lost))
        if self._stopping is not None or self._doing is not None:
            raise UnitBusy(f"{self.name}: {self.job or 'a stop'} is under way; wait for its end, or STOP it")
        if self.party.stopping:
            raise UnitBusy(f"{self.name}: another unit on its line is being stopped; wait for the end of that")
        self.job, self.progress, self.outcome = what, (0, 0, ""), ""
        self._doing = asyncio.create_task(self._do(steps))
        self._doing.add_done_callback(self._done)
        self._tell()
        try:
            result: T = await asyncio.shield(self._doing)
            return result
        except asyncio.CancelledError:
            if self._doing is not None and not self._doing.cancelled():
                raise  # who asked went away
            raise UnitBusy(f"{self.name}: {what} was broken off by a stop") from None

    async def _do(self, steps: Steps[T]) -> T:
        looking = self._looking
        if looking is not None:
            await asyncio.wait([looking])
        return await self.shell.perform(steps)

    def _done(self, task: "asyncio.Task[Any]") -> None:
        if self._doing is task:
            self._doing, self.job, self.progress = None, "", (0, 0, "")
        if not task.cancelled():
            task.exception()  # told to whoever asked, if he is still there
        self._tell()

    async def say(self, line: str) -> tuple[Said, float]:
        """A line as it is typed; what was said to it, and how many seconds passed from its first byte to the last."""
        self.tap.sent = self.tap.came = self.tap.began = 0.0  # others on its line may have their turn before
        said = await self.perform(f"the line {line}", say(self.shell.driver, self._chosen(line)))
        return said, max(self.tap.came - self.tap.began, 0.0)

    async def say_lines(self, lines: Sequence[str]) -> list[Said]:
        """Several lines as one job, up to the first that is refused; behind a stop nothing of it is said."""
        return await self.perform(f"the lines {', '.join(lines)}", self._lines(lines))

    def _lines(self, lines: Sequence[str]) -> Steps[list[Said]]:
        found: list[Said] = []
        for line in lines:
            found.append((yield from say(self.shell.driver, self._chosen(line))))
            if found[-1].refused:
                break
        return found

    def _chosen(self, line: str) -> str:
        """A line for this motor: of a board with two it is chosen first, as a look at the other has chosen that."""
        driver = self.shell.driver
        if isinstance(driver, GenStepper) and line.strip()[:1].upper() not in CHOICES:
            return f"{driver.motor}{line.lstrip()}"
        return line

    # -- stop --------------------------------------------------------------------------------------------

    async def stop(self) -> str:
        """Break off whatever is done, and stop the axis: by its ramp; at once if that fails, or at a second call.

        What others do on its line is broken off, too, but not their stops. In words what was done. Raises StopFailed
        where the unit has confirmed neither.
        """
        self._stops.stop(self.name)
        before, self._held_until = self._stopping, 0.0
        if before is not None:
            before.cancel()
        turn = self.party.ask(late=bool(self.trouble))
        task = self._stopping = asyncio.create_task(self._stop(turn, before))
        task.add_done_callback(lambda _: self.party.over(turn))
        self._tell()
        try:
            self.outcome = await asyncio.shield(task)
            return self.outcome
        except asyncio.CancelledError:
            if not task.cancelled():
                raise  # who asked went away; the stop goes on
            return "stopped at once instead"
        except StopFailed as error:
            self.outcome = str(error)
            raise
        finally:
            if self._stopping is task and task.done():
                self._stopping = None
            elif self._stopping is task:
                task.add_done_callback(self._stopped)
            self._tell()

    async def _stop(self, turn: Turn, before: "asyncio.Task[str] | None") -> str:
        if before is not None:
            await asyncio.wait([before])
        at_once = before is not None
        await asyncio.gather(*(unit.make_way(0.0 if at_once else LOOK_SECONDS) for unit in self.party.units))
        await turn.come.wait()
        driver = self.shell.driver
        assert isinstance(driver, Axis)
        why = ""
        patience = DEAF_SECONDS if isinstance(driver, Dcb274) else RAMP_SECONDS
        ways = ((driver.stop, patience, "stops by its ramp"), (driver.halt, HALT_SECONDS, "stopped at once"))
        for way, seconds, words in ways[at_once:]:
            for again in (False, True):
                try:
                    await asyncio.wait_for(self.shell.perform(way()), seconds)
                    return words + (f", because {why}" if why else "")
                except (BadAnswer, Refused) as error:
                    if not again:
                        continue  # that may have been the answer to what was broken off
                    why = why or told(error)
                except (DriverError, ValueError, OSError) as error:  # a TimeoutError is an OSError
                    why = why or told(error) or f"it did not take its stop command within {seconds:g} s"
                    break
        raise StopFailed(f"STOP was not confirmed: {why}. If it moves, switch off the supply of its motor")

    def _stopped(self, task: "asyncio.Task[str]") -> None:
        if self._stopping is task:
            self._stopping = None
        if not task.cancelled():
            error = task.exception()
            self.outcome = str(error) if error is not None else task.result()
        self._tell()

    async def make_way(self, patience: float = 0.0) -> None:
        """End whatever is done with it but a stop; the port is free then. A look may still take so many seconds."""
        if self._looking is not None and patience:
            # a look that goes well is over in a moment; the rest of its answer would come in the way of what follows
            await asyncio.wait([self._looking], timeout=patience)
        await _ended(self._looking, self._doing)

    async def _break_off(self) -> None:
        """End whatever is done with it, a stop too."""
        await self.make_way()
        await _ended(self._stopping)

    # -- a key that is held ------------------------------------------------------------------------------

    async def hold(self, rate: float) -> None:
        """Run at `rate` as long as `still_held` is called. Raises as `perform`.

        Where it may run for all that, it is stopped. A key that is held already, in another window, is held on if this
        one comes to nothing.
        """
        if self.manual.hold:
            raise ValueError(self.manual.hold)
        driver = self.shell.driver
        assert isinstance(driver, Axis)
        check_moves(driver)
        loop = asyncio.get_running_loop()
        already = self._held_until > 0
        self._held_until = loop.time() + HOLD_SECONDS
        self._guard = asyncio.create_task(self._dead_man())
        try:
            await self.perform("jog", run_at(driver, rate))
        except (UnitBusy, Overtaken, Refused, ValueError):  # it does not run for this
            if not already:
                self._held_until = 0.0
            raise
        except BaseException:  # its answer was damaged, say: nobody says that the key is held, and the axis is stopped
            if self._held_until:
                self._held_until = loop.time()
            raise

    async def _dead_man(self) -> None:
        """Stop the axis when the key is no longer said to be held; a look that gets no answer does not delay it."""
        loop = asyncio.get_running_loop()
        while self._held_until:
            if loop.time() > self._held_until:
                with contextlib.suppress(StopFailed):  # it is told in `outcome`
                    await self.stop()
            await asyncio.sleep(WATCH)

    def still_held(self) -> None:
        """The key is still held. Raises Overtaken where it was stopped since the key was pressed."""
        self._stops.check(UNITS, self.name)
        if self._held_until:
            self._held_until = asyncio.get_running_loop().time() + HOLD_SECONDS

    # -- looking -----------------------------------------------------------------------------------------

    async def _look_on(self) -> None:
        loop = asyncio.get_running_loop()
        due = loop.time()
        while not self._closed:
            if self._doing is None and not self.party.stopping and not self.tap.lost:
                if not self.paused and loop.time() >= due:
                    await self._look()
                    due = loop.time() + min(2.0 ** min(self._failures, 10) / self.rate, max(SLOWEST, 1 / self.rate))
                else:
                    await self._see_port()
            await asyncio.sleep(WATCH)

    async def _see_port(self) -> None:
        before = self.tap.transcript.count
        with contextlib.suppress(OSError):
            await self.tap.look()
        if self.tap.lost:
            self._unknown(f"the port is gone: {self.tap.lost}")
        elif self.tap.transcript.count != before:
            self._tell()  # it talks without being asked

    async def _look(self) -> None:
        begin = self.tap.clock()
        self.tap.transcript.looking = True
        self._looking = asyncio.create_task(self.shell.perform(look(self.shell.driver)))
        await asyncio.wait([self._looking])
        self.tap.transcript.looking = False
        task, self._looking = self._looking, None
        if task.cancelled():
            return
        error = task.exception()
        if error is None:
            self.seen, self.trouble, self._failures = task.result(), "", 0
            self.last = self.seen.position if self.seen.position is not None else self.last
            self.took = max(self.tap.clock() - begin, 0.0)
            self._tell()
        elif isinstance(error, DriverError | ValueError | OSError):
            self._failures += 1
            self._unknown(told(error))
            if self.model == "dcb-274":  # the next question would begin by connecting anew, which a person must want
                self.paused = True
                self._tell()
        else:
            raise error

    def _unknown(self, why: str) -> None:
        """Nothing is known of it any more."""
        self.seen, self.trouble = None, why
        self._tell()

    def _watch(self, step: Progress) -> None:
        self.progress = (step.done, step.total, step.what)
        self._tell()

    def _tell(self) -> None:
        self._told(self)


async def _ended(*tasks: "asyncio.Task[Any] | None") -> None:
    """Cancel these, and wait until they have ended."""
    there = [task for task in tasks if task is not None]
    for task in there:
        task.cancel()
    if there:
        await asyncio.wait(there)


def phrases(model: str, options: Mapping[str, Any]) -> Phrases:
    """What is said on the line of such a unit, in words. Raises ValueError for a model that nobody drives."""
    host(model)
    straps: dict[str, Level] = {}
    if "checksums" in options:
        straps["CHS"] = HIGH if options["checksums"] else LOW
    if options.get("address") is not None:
        straps |= select(int(options["address"]))
    return catalogue.model(model).phrases(straps)
