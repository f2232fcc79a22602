"""The units that are connected, and the calls of windows for them.

Each is shown as ``r.NAME`` in the table (`Unit.facts`), their names as ``r.names``.
"""

import asyncio
import contextlib
import hashlib
import json
from collections.abc import Awaitable, Callable, Sequence
from difflib import unified_diff
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, cast

from pydantic import Field

from detent.assembler import AssemblyFailed, assemble
from detent.controllers import catalogue
from detent.hosts.axis import Axis
from detent.hosts.backups import Backup, BackupError
from detent.hosts.errors import told
from detent.hosts.exchange import Steps
from detent.hosts.typed import Said
from detent.outputs.files import write_whole
from detent.workbench.answers import BackupDifferences, LineSaid, UnitRow, UnitTalk
from detent.workbench.beside import beside
from detent.workbench.folder import Folder
from detent.workbench.live import Live
from detent.workbench.stopping import StopFailed, Stopping
from detent.workbench.stops import UNITS
from detent.workbench.talk import Row
from detent.workbench.units import manual
from detent.workbench.units.backups import backup_of, check_fits, explained, file_before
from detent.workbench.units.beside import emulated
from detent.workbench.units.programs import lines_of, numbered_lines_of, places_of, source_of
from detent.workbench.units.transcript import HOST
from detent.workbench.units.unit import RATES, Unit, options_of

if TYPE_CHECKING:
    from detent.workbench.client import Bench
    from detent.workbench.messages import Picture

T = TypeVar("T")
Name = Annotated[str, Field(max_length=200)]
Line = Annotated[str, Field(max_length=300)]
Text = Annotated[str, Field(max_length=1 << 20)]
Rate = Annotated[float, Field(allow_inf_nan=False, ge=-1e6, le=1e6)]
ManualMove = Literal["jog", "go", "zero", "home"]
MOST = 16  # units at once
MOVING = ("unit_move", "unit_hold", "unit_held", "unit_say", "unit_lines", "unit_both", "unit_store", "unit_restore")
"""What moves a real unit, or may."""


class Units:
    """The units that are connected to this workbench."""

    def __init__(self, live: Live, stopping: Stopping, folder: Folder, state: Path) -> None:
        """Backups are read and written in `folder`; what a restore replaces is kept below `state`."""
        self._live, self._stopping, self._folder, self._state = live, stopping, folder, state
        self._units: dict[str, Unit] = {}
        self._leaving: set[asyncio.Task[None]] = set()
        self._coming: dict[str, asyncio.Task[Unit]] = {}  # those that are being connected to: two clicks are one
        self._connecting = asyncio.Lock()  # one after the other: who shares a line must know who is there
        self._turning = asyncio.Lock()  # the last word counts, not the last to be done
        live.put({"r.names": []})
        for call in (self.unit_connect, self.unit_again, self.unit_leave, self.unit_say, self.unit_lines,
                     self.unit_both, self.unit_move, self.unit_hold, self.unit_held, self.unit_stop,
                     self.unit_asking, self.unit_talk, self.unit_source, self.unit_compare, self.unit_store,
                     self.unit_backup, self.unit_differs, self.unit_restore):  # fmt: skip
            name = call.__name__
            live.offer(name, call, moves=UNITS if name in MOVING else "", stops=name == "unit_stop")

    # -- connecting --------------------------------------------------------------------------------------

    async def unit_connect(self, model: Name, address: Name, options: Line = "", name: Name = "") -> str:
        """Connect to a unit and look at it from now on; how it is called. Raises ValueError, PortError."""
        name = name or " ".join(word for word in (model, address, options) if word)
        if name not in self._units:
            coming = self._coming.get(name)
            if coming is None:
                coming = self._coming[name] = asyncio.create_task(self._connect(name, model, address, options))
                self._stopping.add(name, partial(self._stop_coming, name, coming))
                coming.add_done_callback(lambda _: self._came(name))
            await asyncio.shield(coming)
        return name

    async def _connect(self, name: str, model: str, address: str, options: str) -> Unit:
        async with self._connecting:
            if len(self._units) >= MOST:
                raise ValueError(f"{MOST} units are connected: leave one of them first")
            beside = next((unit for unit in self._units.values() if unit.address == address), None)
            unit = await Unit.open(
                name, model, address, options_of(options), self._tell, self._live.stops, beside
            )  # fmt: skip
        self._units[name] = unit
        self._stopping.add(name, unit.stop)
        self._tell(unit)
        self._live.put({"r.names": list(self._units)})
        unit.begin()
        return unit

    def _came(self, name: str) -> None:
        """It is connected to, or not."""
        coming = self._coming.pop(name)
        if coming.cancelled() or coming.exception() is not None:
            self._stopping.remove(name)

    async def _stop_coming(self, name: str, coming: "asyncio.Task[Unit]") -> str:
        """Stop a unit that is being connected to, once it is; nothing that was asked for before moves it."""
        self._live.stops.stop(name)
        try:
            unit = await asyncio.shield(coming)
        except (ValueError, OSError) as error:
            raise StopFailed(f"it cannot be connected to, so nothing was sent: {told(error)}") from error
        return await unit.stop()

    async def unit_again(self, name: Name) -> None:
        """After the port was lost, or the unit did not answer."""
        await self._unit(name).connect()

    async def unit_leave(self, name: Name) -> None:
        """Let go of a unit and its port; it does what it does."""
        unit = self._unit(name)
        del self._units[name]
        self._stopping.remove(name)
        self._live.put({"r.names": list(self._units)})
        self._live.put({f"r.{name}": None})  # behind the names: nobody shows it by then
        await unit.close()

    def follow(self, bench: "Bench") -> None:
        """Let go of the units of the cell of `bench` when its process is another one, or they are not in it any more.

        Who wants to speak to them again connects anew: what is at their address by then may be something else.
        """
        ends, process = _ends(bench), bench.engine_pid

        def look() -> None:
            nonlocal ends, process
            if bench.engine_pid is None or (bench.picture is ends[0] and bench.engine_pid == process):
                return
            (_, before), same = ends, bench.engine_pid == process
            ends, process = _ends(bench), bench.engine_pid
            for unit in list(self._units.values()):
                end = unit.model, unit.address
                if end in before and not (same and end in ends[1]):
                    leaving = asyncio.create_task(self.unit_leave(unit.name))
                    self._leaving.add(leaving)
                    leaving.add_done_callback(self._left)

        bench.on_change(look)

    def _left(self, leaving: "asyncio.Task[None]") -> None:
        self._leaving.discard(leaving)
        if not leaving.cancelled():
            leaving.exception()  # its port is gone, or somebody has left it meanwhile

    async def close(self) -> None:
        """Let go of all of them."""
        for coming in self._coming.values():
            coming.cancel()
        for name in list(self._units):
            with contextlib.suppress(OSError):
                await self.unit_leave(name)

    def _unit(self, name: str) -> Unit:
        try:
            return self._units[name]
        except KeyError:
            raise ValueError(f"no unit {name!r} is connected") from None

    def _tell(self, unit: Unit) -> None:
        if self._units.get(unit.name) is unit:
            self._live.put({f"r.{unit.name}": unit.facts})

    # -- hands -------------------------------------------------------------------------------------------

    async def unit_move(self, name: Name, what: ManualMove, value: int = 0) -> list[str]:
        """Jog by `value` steps, go to it, call where the axis stands zero, find home; what was sent, in words."""
        unit = self._unit(name)
        axis = _axis(unit)
        manual.check_moves(axis)
        steps: Steps[None]
        match what:
            case "jog":
                steps, words = manual.jog(axis, value), f"jog {value:+d}"
            case "go":
                steps, words = manual.go_to(axis, value), f"go to {value}"
            case "zero":
                steps, words = manual.set_zero(axis), "set zero"
            case "home":
                if unit.manual.home:
                    raise ValueError(unit.manual.home)
                steps, words = manual.home(axis, value or -1), "home"
        return await self._shown(unit, unit.perform(words, steps))

    async def unit_hold(self, name: Name, rate: Rate) -> list[str]:
        """A key is held: run at `rate` steps/s for as long as `unit_held` is called, about every 0.3 s."""
        unit = self._unit(name)
        return await self._shown(unit, unit.hold(rate))

    async def unit_held(self, name: Name) -> None:
        """The key is still held."""
        self._unit(name).still_held()

    async def unit_stop(self, name: Name) -> str:
        """Stop one unit, if it is still being connected to as soon as it is; once more stops it at once.

        Raises StopFailed.
        """
        coming = self._coming.get(name)
        return await (self._unit(name).stop() if coming is None else self._stop_coming(name, coming))

    async def _shown(self, unit: Unit, action: Awaitable[object]) -> list[str]:
        """Do it; the lines that were sent meanwhile."""
        begin = unit.tap.transcript.next()
        await action
        questions = unit.tap.transcript.questions
        rows = [row for row in unit.tap.transcript.since(begin).rows if row.number not in questions]
        return [
            f"{_text(row)} · {row.note.rstrip('.')}" if row.note else _text(row)
            for row in rows
            if row.sender == HOST and row.number not in unit.tap.transcript.questions
        ]

    # -- the line ----------------------------------------------------------------------------------------

    async def unit_say(self, name: Name, line: Line) -> LineSaid:
        """A line as it is typed; what came of it."""
        return await self._said(self._unit(name), line)

    async def unit_lines(self, name: Name, lines: Sequence[Line]) -> list[LineSaid]:
        """Several lines, one after the other; what came of each. Nothing follows one that is refused, nor a STOP."""
        return [_line_said(name, said) for said in await self._unit(name).say_lines(lines)]

    async def unit_both(self, names: Sequence[Name], line: Line) -> list[LineSaid]:
        """The same line to several units at once; what came of it at each, an error too."""
        units = [self._unit(name) for name in names]
        return list(await asyncio.gather(*(self._tried(unit, line) for unit in units)))

    async def _tried(self, unit: Unit, line: str) -> LineSaid:
        try:
            return await self._said(unit, line)
        except (RuntimeError, ValueError, OSError) as error:
            return _line_said(unit.name, Said((), told(error), refused=True))

    async def _said(self, unit: Unit, line: str) -> LineSaid:
        said, seconds = await unit.say(line)
        return _line_said(unit.name, said, round(1000 * seconds, 1))

    async def unit_talk(self, name: Name, since: int = 0) -> UnitTalk:
        """Rows of what was said, as the page Terminal has them."""
        transcript = self._unit(name).tap.transcript
        talk = transcript.since(since)
        rows: list[UnitRow] = [
            {
                "number": row.number, "begin": row.begin, "sender": row.sender, "note": row.note, "wrong": row.wrong,
                "question": row.number in transcript.questions,
                "parts": [(part.kind, part.text, part.meaning, part.data.hex(" ")) for part in row.parts],
            }
            for row in talk.rows[-400:]
        ]  # fmt: skip
        return {"first": rows[0]["number"] if rows else talk.first, "next": talk.next, "rows": rows}

    async def unit_asking(self, name: Name, paused: bool, rate: float = 1.0) -> None:
        """Ask no more, or again, so many times a second."""
        unit = self._unit(name)
        unit.rate = min(RATES, key=lambda one: abs(one - rate))
        async with self._turning:
            if unit.paused and not paused:
                await unit.connect()
            unit.paused = paused
        self._tell(unit)

    # -- its program -------------------------------------------------------------------------------------

    async def unit_source(self, name: Name) -> str:
        """The program of a unit, as source with labels."""
        unit = self._unit(name)
        language = catalogue.language(unit.model)
        lines: list[str] = await unit.perform("reading the program", cast(Any, unit.shell.driver).read_program())
        left = getattr(unit.shell.driver, "left_over", "")
        older = f"{language.comment} left of an older program at {left}, behind an end mark\n" if left else ""
        return source_of(language, lines) + older

    async def unit_compare(self, name: Name, source: Text) -> list[str]:
        """How the program of a unit and `source` differ, as the lines of a diff; none: they are the same."""
        unit = self._unit(name)
        assembly = await beside(_assembled, unit, source)
        there = await unit.perform("comparing the program", places_of(unit.shell.driver, assembly))
        return list(unified_diff(there, numbered_lines_of(assembly), "the unit", "the text", lineterm="", n=2))

    async def unit_store(self, name: Name, source: Text, save: bool = False) -> str:
        """Store a program, verified; with `save` it is kept over a power-off, too. It is not started."""
        unit = self._unit(name)
        assembly = await beside(_assembled, unit, source)
        lines = lines_of(assembly)
        driver = cast(Any, unit.shell.driver)
        await unit.perform("storing the program", driver.write_program(lines))
        if save:
            await unit.perform("saving the program", driver.save())
        kept = ", and saved" if save else ""
        left_open = getattr(unit.shell.driver, "left_open", "")
        open_ = f"; what it is sent now is stored, too: {left_open}" if left_open else ""
        return f"{len(lines)} instructions, {assembly.used} bytes: stored, read back{kept}{open_}"

    # -- its backup --------------------------------------------------------------------------------------

    async def unit_backup(self, name: Name, file: Name, over: bool = False) -> str:
        """Write everything that a unit tells of what it keeps to a file in the folder; nothing in it is changed."""
        unit = self._unit(name)
        path = self._folder.path(file)
        if path.exists() and not over:
            raise FileExistsError(f"{file} is there already: give it another name, or say that it may be replaced")
        backup = await self._kept(unit)
        self._folder.write(file, backup.text(explained(unit.model)).encode())
        return file

    async def unit_differs(self, name: Name, file: Name) -> BackupDifferences:
        """What restoring a file changes in a unit; `seen` goes with `unit_restore`."""
        unit = self._unit(name)
        wanted = self._wanted(unit, file)
        there = await self._kept(unit)
        return {"lines": wanted.differences(there.saved), "seen": _digest(wanted, there)}

    async def unit_restore(self, name: Name, file: Name, seen: Name) -> list[str]:
        """Write a backup to a unit whose differences were `seen`; what it held before is kept in a file."""
        unit = self._unit(name)
        wanted = self._wanted(unit, file)
        there = await self._kept(unit)
        if _digest(wanted, there) != seen:
            raise ValueError("the file or the unit has changed since you looked: look at the differences again")
        before = file_before(unit.model, self._state)
        before.parent.mkdir(parents=True, exist_ok=True)
        write_whole(before, there.text(explained(unit.model)).encode())
        try:
            lines: list[str] = await unit.perform("restoring", cast(Any, unit.shell.driver).restore(wanted.saved))
        except RuntimeError as error:
            raise RuntimeError(f"{told(error)}; what the unit held before is in {before}") from error
        return [*lines, f"What it held before is in {before}"]

    def _wanted(self, unit: Unit, file: str) -> Backup:
        try:
            wanted = Backup.parse(self._folder.read_text(file))
            check_fits(wanted.model, unit.model)
        except BackupError as error:
            raise ValueError(f"{file}: {error}") from None
        return wanted

    async def _kept(self, unit: Unit) -> Backup:
        driver = unit.shell.driver
        saved: Callable[[], Steps[dict[str, Any]]] | None = getattr(driver, "saved", None)
        if saved is None:
            raise ValueError(f"a {unit.model} keeps nothing that it tells: what it knows is burnt into its EPROM")
        return backup_of(unit.model, unit.address, await unit.perform("reading what it keeps", saved()))


def _ends(bench: "Bench") -> tuple["Picture", set[tuple[str, str]]]:
    """The picture of the cell of `bench`; model and address of each unit that it has."""
    return bench.picture, {(one.model, one.address) for one in emulated(bench.picture)}


def _line_said(unit: str, said: Said, ms: float | None = None) -> LineSaid:
    return {"unit": unit, "answers": said.answers, "meaning": said.meaning, "refused": said.refused,
            "meanings": said.meanings, "ms": ms}  # fmt: skip


def _axis(unit: Unit) -> Axis:
    driver = unit.shell.driver
    assert isinstance(driver, Axis)
    return driver


def _text(row: Row) -> str:
    return " ".join(part.text for part in row.parts)


def _assembled(unit: Unit, source: str) -> Any:
    try:
        return assemble(catalogue.language(unit.model), source, "the text")
    except AssemblyFailed as error:
        raise ValueError(str(error)) from None


def _digest(wanted: Backup, there: Backup) -> str:
    both = json.dumps([wanted.saved, there.saved], sort_keys=True, default=str)
    return hashlib.sha256(both.encode()).hexdigest()
