"""The workbench's side of a cell that runs in a process of its own: what pages look at, and what they do to it.

One `Bench` is shared by all windows. Everything here runs on the event loop of the page server; nothing waits for the
drawing, and drawing never delays the cell: what happened is streamed here, and signals are made of it here.
"""

import asyncio
import contextlib
import pickle
import sys
import time
from asyncio.subprocess import Process
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from detent.cell.description import Problem
from detent.cell.moments import Cut
from detent.pins import Level
from detent.realtime.cell_source import find_cell
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.endpoints.tcp import TcpAddress
from detent.ticks import Ns
from detent.workbench import exports, joining, saving
from detent.workbench.messages import (
    MOVES,
    Answer,
    Ask,
    Failed,
    Happened,
    Mark,
    Marked,
    Opened,
    Order,
    Picture,
    State,
)
from detent.workbench.mirror import Mirror
from detent.workbench.pipe import HEAD, packed
from detent.workbench.programs import Program
from detent.workbench.scope import Scope, ScopeData, Trace, Trigger
from detent.workbench.talk import Talk, Talks

LEAVING = 5.0  # seconds that an engine has to end
STOP_SECONDS = 2.0  # that it has to confirm an emergency stop
UNDRIVEN = (
    "the steps that its boards were given end within a moment, and their outputs fall when their watchdog runs out. "
    "If anything moves, switch off the supply of its motor"
)


class BenchError(RuntimeError):
    """Something that could not be done. The text is one line for the person who asked, with the remedy."""


class Bench:
    """A cell in its own process. Make it with `open`.

    Every action is a coroutine that returns when it is done in the cell; BenchError says why it is not. An action while
    the cell stands in its past drops what lies behind (so does `go`); looking and stepping do not.
    """

    _mirror: Mirror
    _scope: Scope
    _talks: Talks
    picture: Picture
    """What never changes: units, pins, wires, motors, lines with their endpoints."""
    state: State
    """The latest look at the cell."""
    crashed: str | None
    """Why the engine is gone, in a line; None while it lives. `revive` starts it anew."""
    sources: Mapping[str, str]
    """The texts of the programs that the cell file names, by unit."""
    control_url: str | None
    """Where programs look at the cell and meddle with it; None if nowhere."""
    cut: int
    """How often the past was changed: what was drawn from `scope` or `terminal` before is no longer true."""
    check_moves: Callable[[], None]
    """Called before whatever may move a machine is asked of the engine. It raises where that is not to be done."""

    @classmethod
    async def open(
        cls,
        target: str,
        *,
        straps: Sequence[str] = (),
        options: Sequence[str] = (),
        endpoints: Sequence[EndpointSpec] = (),
        pace: float | None = 1.0,
        line_timing: bool = True,
        state_dir: Path | None = None,
        held: bool = False,
        real: bool = False,
        memory: int = 512,
        control: TcpAddress | None = None,
        token: str | None = None,
    ) -> "Bench":
        """Start the engine for `target`, a model or a cell file, and wait until it serves.

        `straps` and `options` are written as for `serve` (PIN=LEVEL or UNIT.PIN=LEVEL). `endpoints`: of every
        line; none: what the cell file says, or a pty. `state_dir` keeps EEPROM images. `real` drives the pins of its
        boards. The past that is kept takes about `memory` MB; what is older is dropped. At `control` programs look and
        meddle (`control_url`) that know the `token`. Raises Problem if it was asked wrongly, BenchError if it failed.
        """
        order = Order(target, tuple(straps), tuple(options), tuple(endpoints), pace, line_timing, state_dir, held)
        bench = cls(order._replace(memory=memory, real=real, control=control, token=token))
        try:
            await bench._start(bench._order)
        except BaseException:
            await bench.close()
            raise
        return bench

    def __init__(self, order: Order) -> None:
        """Use `open`."""
        self.crashed = None
        self.cut = 0
        self.check_moves = lambda: None
        self._order = order
        self._heard = time.monotonic()
        self._process: Process | None = None
        self._writer: asyncio.StreamWriter | None = None
        self._reader: asyncio.Task[None] | None = None
        self._asked: dict[int, asyncio.Future[Any]] = {}
        self._number = 0
        self._callbacks: list[Callable[[], None]] = []
        self._waiting: list[asyncio.Future[State]] = []
        self._marks: tuple[Mark, ...] = ()
        self._ready: asyncio.Future[None] | None = None
        self._closing = False
        self._opening = asyncio.Lock()  # one engine at a time is begun

    # -- the engine ----------------------------------------------------------------------------------------

    async def _start(self, order: Order) -> None:
        """Start an engine and wait until it serves."""
        self._process, ours = await joining.started()
        try:
            if order.real:
                self.check_moves()  # it moves what it drives as soon as it lives: a program that is kept may begin
        except BaseException:
            ours.close()  # it ends
            raise
        reader, self._writer = await asyncio.open_connection(sock=ours)
        self._ready = asyncio.get_running_loop().create_future()
        self._writer.write(packed(order))
        self._reader = asyncio.create_task(self._read(reader, self._process))
        await self._ready

    @property
    def engine_pid(self) -> int | None:
        """The process of the engine, while it lives."""
        process = self._process
        return process.pid if process is not None and process.returncode is None else None

    async def _read(self, reader: asyncio.StreamReader, process: Process) -> None:
        """Take what the engine tells, until it ends."""
        failed: Failed | None = None
        with contextlib.suppress(asyncio.IncompleteReadError, ConnectionError):
            while True:
                (length,) = HEAD.unpack(await reader.readexactly(HEAD.size))
                message = pickle.loads(await reader.readexactly(length))  # of the process that we made
                if isinstance(message, Failed):
                    failed = message
                else:
                    self._take(message)
        status = await process.wait()
        self._ended(failed, status)

    def _ended(self, failed: Failed | None, status: int) -> None:
        """The engine is gone: who waits for it is told why."""
        if failed is not None:
            why, trace = failed.text, failed.trace
        else:
            why = f"it was ended by signal {-status}" if status < 0 else f"it ended with status {status}"
            trace = ""
        if trace:
            print(trace, file=sys.stderr)
        error: Exception
        if failed is not None and failed.asked_wrongly:
            error = Problem("", "", why)
        else:
            error = BenchError(f"the cell's process is gone: {why}")
        if self._ready is not None and not self._ready.done():
            self._ready.set_exception(error)
        elif not self._closing:
            self.crashed = f"{error}: {UNDRIVEN}" if self._order.real else str(error)
        if self._writer is not None:
            self._writer.close()
        for future in (*self._asked.values(), *self._waiting):
            if not future.done():
                future.set_exception(BenchError(str(error)))
        self._asked.clear()
        self._waiting.clear()
        self._call_back()

    @property
    def silent(self) -> float:
        """Seconds since the engine should have said something: time goes, or it was asked. 0.0 while all is well."""
        due = bool(self._asked) or not self.state.held
        there = self.engine_pid is not None and not self._opening.locked()
        return time.monotonic() - self._heard if due and there else 0.0

    def _take(self, message: object) -> None:
        self._heard = time.monotonic()
        match message:
            case Happened():
                self._mirror.take(message)
            case State():
                self.state = message._replace(marks=self._marks)
                self._mirror.until = self.state.end
                if self._ready is not None and not self._ready.done():
                    self._ready.set_result(None)
                self._tell()
            case Answer(number, value, error):
                future = self._asked.pop(number, None)
                if future is not None and not future.done():
                    if error is None:
                        future.set_result(value)
                    else:
                        future.set_exception(BenchError(error))
            case Marked(marks):
                self._marks = marks
            case Cut():
                self._mirror.cut(message)
                self.cut += 1
            case Opened(picture, sources, _, url):
                self.picture, self.sources, self.control_url = picture, sources, url
                if url is not None and self._order.control is not None:  # an engine after this one is found there, too
                    port = urlsplit(url).port or 0
                    self._order = self._order._replace(control=self._order.control._replace(port=port))
                self._mirror, self._marks = Mirror(message), ()
                self._scope = Scope(picture, self._mirror)
                self._talks = Talks(picture, self._mirror)
                self.cut += 1

    def _tell(self) -> None:
        waiting, self._waiting = self._waiting, []
        for future in waiting:
            if not future.done():
                future.set_result(self.state)
        self._call_back()

    def _call_back(self) -> None:
        for callback in list(self._callbacks):
            try:
                callback()
            except Exception as error:  # a page that is broken must not take the others along
                print(f"detent: a page failed at a change: {error!r}", file=sys.stderr)
                with contextlib.suppress(ValueError):
                    self._callbacks.remove(callback)

    async def _ask(self, verb: str, *arguments: object) -> Any:
        """Have a verb of the engine done. Raises BenchError."""
        if self._writer is None or self._reader is None or self._reader.done():
            raise BenchError(self.crashed or "the workbench is closed")
        if verb in MOVES and self._order.real:
            self.check_moves()
        if not self._asked:
            self._heard = time.monotonic()
        self._number += 1
        future = asyncio.get_running_loop().create_future()
        self._asked[self._number] = future
        self._writer.write(packed(Ask(self._number, verb, arguments)))
        return await future

    async def kill(self) -> None:
        """End an engine that does not answer; whoever waits for it is told."""
        process, reader = self._process, self._reader
        if process is not None and process.returncode is None:
            process.kill()
        if reader is not None:
            await asyncio.wait([reader])

    async def close(self) -> None:
        """End the engine. May be called twice."""
        self._closing = True
        if self._writer is not None:
            self._writer.close()
        if self._process is not None and self._process.returncode is None:
            try:
                await asyncio.wait_for(self._process.wait(), LEAVING)
            except TimeoutError:
                self._process.kill()
                await self._process.wait()
        if self._reader is not None:
            await self._reader
        if self._writer is not None:
            with contextlib.suppress(ConnectionError):
                await self._writer.wait_closed()

    # -- being told ----------------------------------------------------------------------------------------

    def on_change(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Call `callback` whenever `state`, `picture` or `crashed` has changed, at most some 20 times a second.

        Returns what ends that. Callbacks are quick; one that raises is dropped.
        """
        self._callbacks.append(callback)

        def end() -> None:
            with contextlib.suppress(ValueError):
                self._callbacks.remove(callback)

        return end

    async def changed(self) -> State:
        """Wait for the next change and return the state then. Raises BenchError if the engine ends before."""
        if self._reader is None or self._reader.done():
            raise BenchError(self.crashed or "the workbench is closed")
        future = asyncio.get_running_loop().create_future()
        self._waiting.append(future)
        state: State = await future
        return state

    async def until(self, condition: Callable[[State], bool]) -> State:
        """Wait until the state meets `condition`, which is tried at once and then at every change.

        Raises BenchError if the engine ends before.
        """
        while not condition(self.state):
            await self.changed()
        return self.state

    # -- time ----------------------------------------------------------------------------------------------

    async def hold(self) -> None:
        """The cell stands."""
        await self._ask("hold")

    async def go(self) -> None:
        """The cell goes on from where it stands; what lay behind is dropped."""
        await self._ask("go")

    async def pace(self, factor: float | None) -> None:
        """So many times as fast as real time; None: as fast as it goes. Holding is not changed by it."""
        await self._ask("pace", factor)

    async def step_event(self) -> None:
        """Hold, and let the next instant happen in which something does. In the past: the one that came next then."""
        await self._ask("step_event")

    async def step_instruction(self, unit: str) -> None:
        """Hold, and go on to the next instruction of the unit's program, or to a stop that comes before it.

        Where none comes within a minute of the cell's time, it stops there and says so.
        """
        await self._ask("step_instruction", unit)

    async def step_back(self, unit: str | None = None) -> None:
        """Hold, and go back to the event before; with a unit to the instruction before."""
        await self._ask("step_back", unit)

    async def rewind(self, at: Ns) -> None:
        """Hold; the cell is as it was at `at`, between `state.begin` and `state.end` (limited to them).

        What lies behind stays until the cell goes on with something new: `rewind(state.end)` goes to the present.
        """
        await self._ask("rewind", at)

    async def alarm(self, who: str, at: Ns | None) -> None:
        """Let time come to `at` for `who`, at max as well, where nothing else may be due; None: no longer."""
        await self._ask("alarm", who, at)

    async def take_branch(self, number: int) -> None:
        """Hold, and let a future happen again that was left (`state.branches`); the one that is left for it is kept."""
        await self._ask("take_branch", number)

    async def compare_branch(self, number: int) -> list[str]:
        """What is different in that future from what happened here, at the end of the shorter one, in words."""
        words: list[str] = await self._ask("compare_branch", number)
        return words

    async def run_to(self, unit: str, address: int) -> None:
        """Go on, and stop when the unit's program comes to `address`."""
        await self._ask("run_to_address", unit, address)

    async def set_breakpoints(self, unit: str, addresses: Iterable[int]) -> None:
        """The cell stops whenever the unit's program comes to one of these addresses, before it goes on."""
        await self._ask("set_breakpoints", unit, tuple(addresses))

    async def set_breakpoint(self, unit: str, address: int, *, on: bool) -> None:
        """One of them is there from now on, or not."""
        await self._ask("set_breakpoint", unit, address, on)

    async def break_on_errors(self, on: bool) -> None:
        """The cell stops whenever a unit refuses something."""
        await self._ask("set_break_on_errors", on)

    # -- actions ---------------------------------------------------------------------------------------------

    async def power(self, unit: str, on: bool) -> None:
        """Switch the supply of a unit."""
        await self._ask("power", unit, on)

    async def set_switch(self, name: str, level: Level) -> None:
        """Put a switch to a level."""
        await self._ask("set_switch", name, level)

    async def set_pin(self, unit: str, pin: str, level: Level | None) -> None:
        """Hold a wire to an input, or take it away (None): then it has the level of its net again."""
        await self._ask("set_pin", unit, pin, level)

    async def set_strap(self, unit: str, pin: str, level: Level) -> None:
        """Move a strap; it counts from the next power-on. The line then takes the unit's new character format."""
        await self._ask("set_pin", unit, pin, level)

    async def place_switch(self, name: str, low: float | None, high: float | None) -> None:
        """Put a switch elsewhere on its axis: in steps (whole ones without a motor), None is without end."""
        await self._ask("place_switch", name, low, high)

    async def send(self, line: str, data: bytes) -> None:
        """The host of a line sends bytes, beside whoever is connected."""
        await self._ask("send_line", line, data)

    async def type(self, unit: str, text: str) -> None:
        """The host of a unit sends it a command line; address, checksum and end are added."""
        await self._ask("type", unit, text)

    async def queue_send(self, line: str, data: bytes) -> None:
        """The same as `send`; while the cell stands it waits (`state.queue`) until time goes on."""
        await self._ask("queue_send", line, data)

    async def queue_type(self, unit: str, text: str) -> None:
        """The same as `type`; while the cell stands it waits until time goes on."""
        await self._ask("queue_type", unit, text)

    async def withdraw(self, number: int | None = None) -> None:
        """Take back what waits: one, or all of it."""
        await self._ask("withdraw", number)

    async def load(self, unit: str, image: bytes, base: int) -> None:
        """Put a program into program memory (`Program.check`: image and base)."""
        await self._ask("load", unit, image, base)

    async def start(self, unit: str) -> None:
        """Start the program in memory."""
        await self._ask("start", unit)

    async def save(self, unit: str) -> str:
        """Keep program memory without supply, by the unit's own command, sent on its line. What it answered, in words.

        While the cell is held the command waits on the line; the text then says so. Raises BenchError if the unit
        refuses it, or does not answer within two seconds of the cell's time.
        """
        if unit not in self.state.units:
            raise BenchError(f"no unit {unit!r} in this cell")
        kept, words = await saving.saved(self, unit, lambda: self._ask("save", unit))
        if not kept:
            raise BenchError(words)
        return words

    async def read_back(self, unit: str, *, kept: bool = False) -> bytes:
        """The program memory from address 0 on; with `kept`, what is kept without supply. b"" where there is none."""
        image: bytes = await self._ask("read_back", unit, kept)
        return image

    async def breaks(self, given: Mapping[str, object]) -> int:
        """Something breaks: the arguments are those of the verb `fault` of the control API. Its number."""
        number: int = await self._ask("breaks", dict(given))
        return number

    async def mend(self, number: int | None = None) -> None:
        """A fault is mended; all of them without a number."""
        await self._ask("mend", number)

    async def stop_motors(self) -> None:
        """Emergency stop: every board stops at once, and every axis stands until `recover`.

        Where the process that drives them has not confirmed it within `STOP_SECONDS`, it is ended: boards stop when
        nobody drives them. Raises BenchError, also then.
        """
        try:
            await asyncio.wait_for(self._ask("stop_motors"), STOP_SECONDS)
        except TimeoutError:
            await self.kill()
            raise BenchError(f"the process that drives the boards did not answer within {STOP_SECONDS:g} s "
                             f"and was ended: {UNDRIVEN}") from None  # fmt: skip
        except BenchError as error:
            raise BenchError(self.crashed or str(error)) from None

    async def recover(self) -> None:
        """Axes at fault go on from where their motors stand."""
        await self._ask("recover")

    async def restart(self) -> None:
        """Begin anew from the cell file. Endpoints stay open if the lines are the same ones."""
        await self._ask("restart")

    async def revive(self) -> None:
        """After a crash: a new engine with the same cell file, and what was done up to the crash done again.

        Its lines are served where they were: hosts find the same ports and links.

        It is held. If too much was done to be kept, it begins anew, and only programs that were loaded are loaded.
        """
        async with self._opening:
            await self._revive()

    async def _revive(self) -> None:
        if self.engine_pid is not None:
            raise BenchError("the cell's process is alive: restart it instead")
        mirror, end = self._mirror, self.state.end
        actions, until = (tuple(mirror.actions), end) if mirror.complete else (tuple(mirror.loaded.values()), 0)
        self._asked.clear()
        placed = {name: tuple(end.again for end in line.endpoints) for name, line in self.picture.lines.items()}
        for spec in (one for several in placed.values() for one in several):
            if spec.kind == "pty" and spec.where and Path(spec.where).is_symlink():
                Path(spec.where).unlink()  # of the one that is gone; its terminal may be another's by now
        queue = self.state.queue
        await self._start(self._order._replace(actions=actions, until=until, held=True, placed=placed, queue=queue))
        self.crashed = None
        self._call_back()

    async def open_another(self, target: str) -> None:
        """Show the cell of `target` in place of this one, at the endpoints that were asked for, or with its own.

        If that fails the old one is begun anew. Raises Problem, BenchError; also where this one drives a machine.
        """
        if self._order.real:
            raise BenchError("this workbench drives a machine, which would stop wherever it is: "
                             "open the other cell in a workbench of its own")  # fmt: skip
        find_cell(target)  # what is wrong with it is said while the old one goes on
        async with self._opening:
            await self._open_another(target)

    async def _open_another(self, target: str) -> None:
        before = self._order
        order = before._replace(target=target, straps=(), options=(), actions=(), until=0)
        await self.close()
        self._closing, self.crashed = False, None
        self._asked.clear()
        try:
            await self._start(order)
        except (Problem, BenchError):
            await self.close()
            self._closing = False
            await self._start(before)
            raise
        self._order = order._replace(control=self._order.control)
        self._call_back()

    # -- looking at what happened --------------------------------------------------------------------------

    @property
    def traces(self) -> tuple[Trace, ...]:
        """Everything that can be shown over time, in the order of the units."""
        return self._scope.traces

    def scope(self, traces: Sequence[str], begin: Ns, end: Ns, points: int) -> ScopeData:
        """The traces (keys) from `begin` to `end` in at most `points` columns, never under half as many.

        Columns stand on a grid, so that they cover a little more than was asked for. KeyError for an unknown trace.
        """
        return self._scope.columns(traces, begin, end, points, self.state.begin)

    def value_at(self, trace: str, at: Ns) -> float:
        """The exact value of a trace at a time; NaN where nothing is known. For cursors."""
        known = self.state.begin <= at <= self.state.end
        return self._scope.curve(trace).value(at) if known else float("nan")

    def search(self, trigger: Trigger, begin: Ns, end: Ns, most: int = 1000) -> list[Ns]:
        """When the trigger is met, in order, at most so many times. ValueError for one that the trace does not have."""
        return self._scope.search(trigger, max(begin, self.state.begin), end, most)

    async def export(self, kind: str, begin: Ns | None = None, end: Ns | None = None,
                     traces: Sequence[str] = ()) -> bytes:  # fmt: skip
        """What happened as a file: vcd, sr, npz (everything), csv (rows of least and most).

        Traces (keys) and times are for csv; without them all axes, from the beginning of the history to its
        end. Raises BenchError for an unknown kind, and where the format cannot hold it.
        """
        first = self.state.begin if begin is None else max(begin, self.state.begin)
        last = self.state.end if end is None else min(end, self.state.end)
        try:
            return await exports.made(kind, self._mirror, self._scope, traces, first, last)
        except (ValueError, OSError) as error:
            raise BenchError(str(error)) from error

    def terminal(self, line: str, since: int = 0) -> Talk:
        """What was said on a line, from row `since` on. KeyError for an unknown line."""
        return self._talks.of(line, since)

    def program(self, unit: str) -> Program:
        """What an editor must know of the unit's language. KeyError for an unknown unit, ValueError for a part."""
        return Program(self.picture.units[unit].model)
