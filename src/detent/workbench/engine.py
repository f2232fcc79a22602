"""The engine of the workbench: it serves a cell with its past, does what it is asked, and tells what happened.

It runs in a process of its own (`workbench.process`), with a pipe to the process of the pages.
"""

import contextlib
import gc
import socket
import traceback
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import ClassVar, TypeVar

from detent.assembler import ImageError
from detent.cell.actions import (
    Action,
    Break,
    Load,
    Mend,
    PlaceSwitch,
    Power,
    Release,
    Send,
    SetPin,
    SetSwitch,
    Start,
    Type,
)
from detent.cell.cell import Cell
from detent.cell.description import Description, Problem
from detent.cell.history import Broken, History
from detent.cell.real_pins import unreal
from detent.cell.recording import Entry
from detent.cell.stores import Stores
from detent.controllers import catalogue
from detent.outputs.units import views
from detent.pins import Level
from detent.realtime import breaking
from detent.realtime.cell_source import CellSource, find_cell
from detent.realtime.endpoints.endpoint import Endpoint
from detent.realtime.image_names import safe
from detent.realtime.images import Images, cell_name
from detent.realtime.loop import BEHIND, Companion, Loop, ServedLine, stopped_by_signals, wake_exactly
from detent.realtime.names import Names
from detent.realtime.pace import Lateness as Counted
from detent.realtime.pace import Pace, WallNs
from detent.realtime.service import build_with_images, models, open_endpoints
from detent.realtime.verbs import VERBS
from detent.realtime.waiting import Watched
from detent.realtime.watch import Watch
from detent.ticks import Ns
from detent.uart import Chars
from detent.workbench import look, rotors
from detent.workbench.alarms import Alarms
from detent.workbench.marks import Marks
from detent.workbench.memory import keep
from detent.workbench.messages import (
    Answer,
    Ask,
    Failed,
    Happened,
    Marked,
    Opened,
    Order,
    Picture,
    RealState,
    State,
)
from detent.workbench.pipe import Pipe
from detent.workbench.timing import Timing
from detent.workbench.waiting import Waiting, Waits

BY_HAND = "by hand"
BY_PROGRAM = "by a program"  # that controls it
T = TypeVar("T")
WRONG = (Problem, Broken, ImageError, ValueError, KeyError, TypeError)  # of whoever asks


class Engine:
    """A cell that is served with its past. Close it, or use it as a context manager."""

    def __init__(self, end: socket.socket, order: Order) -> None:
        """Build the cell and open its endpoints. Raises Problem, ImagesUnusable, EndpointError, ValueError."""
        self._order = order
        self._timing = Timing()
        self._quiet = False  # nothing has changed since it was last told
        self.waiting = Waiting(order.queue)
        self.control: str | None = None  # the URL of who looks and meddles
        self._cleanup = contextlib.ExitStack()
        with contextlib.ExitStack() as opening:
            found = self._find()
            self._images = self._open_images(found.description)
            if self._images is not None:
                opening.callback(self._images.close)
            self._opening = opening
            cell = self._begin(found)
            self._opened = open_endpoints(
                found.description,
                cell,
                order.endpoints,
                opening,
                placed=order.placed,
                link=self._link if order.state_dir is not None else None,
                on_wire=self._on_wire(),
            )
            self._pipe = Pipe(end, self._heed, self._tick, lambda: self._loop.stop())
            opening.callback(self._pipe.close)
            self._pace = self._made_pace()
            self.change_pace(order.pace)
            endpoints: list[tuple[int, Endpoint]] = [(0, self._pipe), *self._opened]  # what is asked comes first
            patience = [line.format.duration(BEHIND) for line in cell.lines]
            self.watched = Watched(self, self._pace, self._is_present)
            self._alarms = Alarms(self.watched, lambda: self.now)
            self._loop = Loop(self.watched, self._pace, endpoints, patience=patience, companion=self._companion())
            opening.callback(self._loop.close)
            self._again()
            if order.held or order.actions:
                self.hold()
            self._cleanup = opening.pop_all()

    # -- made anew ---------------------------------------------------------------------------------------

    def _find(self) -> CellSource:
        return find_cell(self._order.target, straps=self._order.straps, options=self._order.options)

    def _open_images(self, description: Description) -> Images | None:
        folder = self._order.state_dir
        if folder is None:
            return None
        return Images.of(folder, self._order.target, models(description), is_file=bool(description.file))

    def _link(self, line: str) -> Path:
        """Where a host finds a line by the same name at each start: beside what is kept of the cell."""
        folder, is_file = self._order.state_dir, bool(self._found.description.file)
        assert folder is not None
        link = folder / "ports" / f"{cell_name(self._order.target, is_file=is_file)}-{safe(line)}"
        if self._images is not None and link.is_symlink():
            link.unlink()  # the cell is ours alone, so it was left behind; its terminal may be another's by now
        return link

    def _begin(self, found: CellSource) -> Cell:
        """A new cell, with nothing behind it."""
        self._found, self._reports = found, list[str]()
        self._stores = Stores(self._images.save) if self._images is not None else Stores()
        serial = any(spec.kind == "serial" for spec in self._order.endpoints)  # the wire outside takes the time
        line_timing = self._order.line_timing and not serial
        cell = build_with_images(
            found.description, found.read, self._images, line_timing, self._reports, True, self._stores.save
        )
        self._reports += unreal(found.description, tuple(cell.controllers()), driven=False)
        if self._order.control is not None:
            cell.recording = Watch(cell, passes_on=True)  # for who asks how units stand; copies take theirs along
        shafts = {name: unit.shaft for name, unit in found.description.units.items()}
        self.history = History(cell, self._stores, shafts=shafts, on_stop=self._stopped, keep=keep(self._order.memory))
        self.history.on_notable = self._mark_entry
        for part in self.history.motors:
            rotors.prepare(cell, part)
        self._views = views(cell, shafts)
        self._marks = Marks()
        self._shown: set[int] = set()  # motors of which something was told
        return cell

    def _again(self) -> None:
        """What an engine before this one has done is done again."""
        for action in self._order.actions:
            self.history.run_to(action.at)
            with contextlib.suppress(*WRONG):  # as it was then
                self.history.do(action.what)
        self.history.run_to(self._order.until)

    def _made_pace(self) -> Pace:
        return Pace(self._order.pace or 1, origin=0)

    def _is_present(self) -> bool:
        """Whether the cell stands where it has come to."""
        return not self.history.past

    def _companion(self) -> Companion | None:
        """What is served beside the cell."""
        return None

    def _real_state(self) -> RealState | None:
        """How real pins stand."""
        return None

    def _on_wire(self) -> Callable[[str], None] | None:
        """Who is told that a serial port went away and came back; nobody: the cell ends with it."""
        return None

    def _picture(self) -> Picture:
        description = self._found.description
        return look.picture(description, self._order.target, self.history.cell, self._opened, self._reports)

    def _tell_all(self) -> None:
        description, read = self._found.description, self._found.read
        self._pipe.push(Opened(self._picture(), look.sources(description, read), self._views, self.control))
        self._tell()

    # -- as it is served ---------------------------------------------------------------------------------

    @property
    def now(self) -> Ns:
        """The cell's time."""
        return self.history.now

    @property
    def lines(self) -> Sequence[ServedLine]:
        """The lines."""
        return self.history.lines

    def next_event(self) -> Ns | None:
        """When something happens next by itself."""
        return self.history.next_event()

    def run_to(self, until: Ns) -> None:
        """Let everything happen up to and including `until`."""
        self.history.run_to(until)

    def send(self, line: int, data: Chars) -> None:
        """The host of a line sends `data`, now."""
        self.history.send(line, data)
        self._quiet = False

    @property
    def description(self) -> Description:
        """What the cell was built from."""
        return self._found.description

    @property
    def pacing(self) -> Pace:
        """The clock."""
        return self._pace

    def addresses(self) -> list[tuple[int, str, str]]:
        """Each endpoint: the number of its line, its kind, and what a client connects to."""
        return [(line, endpoint.kind, endpoint.address) for line, endpoint in self._opened]

    def ask(self, function: Callable[[], T]) -> "Future[T]":
        """Call `function` soon on the thread that serves; from any thread."""
        return self._loop.ask(function)

    def run(self) -> None:
        """Serve until the workbench leaves. Raises EndpointLost."""
        wake_exactly()
        self._tell_all()
        gc.freeze()  # what is there now stays: no collection shall look at it while a deadline waits
        self._pace.restart(self.now)
        with stopped_by_signals(self._loop):
            self._loop.run()

    def __enter__(self) -> "Engine":
        return self

    def __exit__(self, *_: object) -> None:
        self._cleanup.close()

    # -- what is told ------------------------------------------------------------------------------------

    def _heed(self, message: object) -> None:
        assert isinstance(message, Ask)
        try:
            value, error = self._VERBS[message.verb](self, *message.arguments), None
        except WRONG as wrong:
            value, error = None, str(wrong.args[0]) if isinstance(wrong, KeyError) and wrong.args else str(wrong)
        self._tell()
        self._pipe.push(Answer(message.number, value, error))

    def _tick(self, wall: WallNs) -> None:
        self._timing.look(wall, self.now, self._pace)
        if not self._pipe.full and not (self._quiet and self._pace.held):
            self._tell()

    def _tell(self) -> None:
        """Everything that is new, and a look at the cell."""
        history, found = self.history, {}
        if not history.past:
            for part in history.motors:
                rows = rotors.rows(history.cell, part, history.now, first=part not in self._shown)
                self._shown.add(part)
                if len(rows):
                    found[history.cell.wiring.names[part]] = rows
        news = history.news()
        if news.cut is not None:
            self._marks.cut(news.cut.at)
            self._pipe.push(news.cut)
        if news.batches or news.actions or found:
            self._pipe.push(Happened(news.first, news.batches, news.actions, found, history.first_batch))
        marks = self._marks.news(history.begin)
        if marks is not None:
            self._pipe.push(Marked(marks))
        self._pipe.push(self._state())
        self._quiet = True

    def _state(self) -> State:
        history, pace = self.history, self._pace
        lines = look.lines(history)
        return State(
            now=history.now,
            begin=history.begin,
            end=history.end,
            pace=None if pace.free else float(pace.factor),
            held=pace.held,
            stopped_why=history.stopped,
            lateness=self._timing.lateness,
            units=look.units(history),
            switches=look.switches(history),
            motors=look.motors(history),
            faults=look.faults(history),
            branches=tuple((branch.number, branch.at, branch.end) for branch in history.branches),
            breakpoints=look.breakpoints(history),
            break_on_errors=history.break_on_errors,
            marks=(),
            formats={name: str(line.format) for name, line in lines.items()},
            speaking={name: line.host_busy_until for name, line in lines.items()},
            dropped=sum(endpoint.dropped for _, endpoint in self._opened),
            faster=self._timing.faster,
            real=self._real_state(),
            queue=self.waiting.queue,
            idle=pace.free and not pace.held and history.cell.next_event() is None,
        )

    def _mark_entry(self, unit: int, entry: Entry) -> None:
        self._marks.entry(self.history.cell.wiring.names[unit], entry)

    def _stopped(self) -> None:
        """The cell stands: so does the clock."""
        why = self.history.stopped
        if why not in (BY_HAND, BY_PROGRAM):
            self._marks.put(self.now, "breakpoint", why)
        self._pace.hold(self.now)
        self._quiet = False

    # -- verbs: time -------------------------------------------------------------------------------------

    def hold(self) -> None:
        """The cell stands."""
        self.history.stop(BY_HAND)

    def go(self) -> None:
        """It goes on."""
        self.send_waiting()
        self.history.go()
        self._pace.go(self.now)

    def change_pace(self, factor: float | None) -> None:
        """So many times as fast as real time; None: as fast as it goes."""
        self._pace.change(factor, self.now)
        self._pace.lateness = Counted()

    def step_event(self) -> None:
        """The next event."""
        self.send_waiting()
        self._stand()
        if not self.history.step():
            self.history.stopped = "nothing more happens by itself"

    def alarm(self, who: str, at: Ns | None) -> None:
        """Let time come to `at` for `who`, at max as well, where nothing else may be due; None: no longer."""
        self._alarms.set(who, at)

    def take_branch(self, number: int) -> None:
        """A future that was left happens again; the one that is left for it is kept."""
        self._stand()
        branch = self.history.leave_for(number)
        self._tell()  # what is dropped is dropped before anything new is told
        self.history.follow(branch)
        self._stand()
        self._pace.hold(self.now)

    def compare_branch(self, number: int) -> list[str]:
        """What is different at the end of that future from what is here at the same time, in words."""
        return look.differences(*self.history.both(number))

    def step_instruction(self, unit: str) -> None:
        """The next instruction of a unit."""
        index = self.history.cell.unit(unit)
        self.send_waiting()
        self._stand()
        why = self.history.step_instruction(index)
        if why:
            self.history.stopped = f"{unit}: {why}"

    def step_back(self, unit: str | None) -> None:
        """The event, or instruction, before."""
        index = None if unit is None else self.history.cell.unit(unit)
        self._stand()
        if not self.history.step_back(index):
            self.history.stopped = "the beginning of what is kept"

    def rewind(self, at: Ns) -> None:
        """The cell as it was."""
        self._stand()
        self.history.rewind(at)

    def _stand(self) -> None:
        """The cell stands, by hand."""
        self.hold()
        self.history.stopped = BY_HAND
        self._quiet = False

    def run_to_address(self, unit: str, address: int) -> None:
        """Go on, and stop there."""
        once = self.history.cell.unit(unit), address
        self.go()
        self.history.once = once

    def set_breakpoints(self, unit: str, addresses: Sequence[int]) -> None:
        """The addresses of a unit at which it stops."""
        index = self.history.cell.unit(unit)
        others = {place for place in self.history.breakpoints if place[0] != index}
        self.history.breakpoints = others | {(index, address) for address in addresses}

    def set_breakpoint(self, unit: str, address: int, on: bool) -> None:
        """One of them is there from now on, or not."""
        place = self.history.cell.unit(unit), address
        self.history.breakpoints = self.history.breakpoints | {place} if on else self.history.breakpoints - {place}

    def set_break_on_errors(self, on: bool) -> None:
        """Whether it stops at errors."""
        self.history.break_on_errors = on

    # -- verbs: actions ------------------------------------------------------------------------------------

    def power(self, unit: str, on: bool) -> None:
        """Switch a supply; it is marked when it happens."""
        self.do(Power(unit, on))

    def set_switch(self, name: str, level: Level) -> None:
        """Put a switch to a level."""
        if name not in self.history.cell.wiring.names[self.history.cell.wiring.units :]:
            raise catalogue.unknown("switch", name, tuple(look.switches(self.history)))
        self.do(SetSwitch(name, level))

    def set_pin(self, unit: str, pin: str, level: Level | None) -> None:
        """Hold a wire to an input, or take it away."""
        part = self.history.cell.parts[self.history.cell.unit(unit)]
        straps = getattr(part, "straps", {})  # a pin of the line may be one, too: RXD of a GS-C200
        known = [p.name for p in part.pins if p.kind.reads or p.name in straps]
        if pin not in known:
            raise catalogue.unknown(f"input of {unit}", pin, known)
        if level is None:
            self.do(Release(unit, pin))
        else:
            self.do(SetPin(unit, pin, level))

    def place_switch(self, name: str, low: float | None, high: float | None) -> None:
        """Put a switch elsewhere on its axis."""
        self.do(PlaceSwitch(name, low, high))

    def send_line(self, line: str, data: bytes) -> None:
        """The host of a line sends."""
        names = self.history.cell.wiring.line_names
        if line not in names:
            raise catalogue.unknown("line", line, names)
        self.do(Send(names.index(line), data))

    def type(self, unit: str, text: str) -> None:
        """The host of a unit sends it a command line."""
        self.do(Type(unit, text))

    def load(self, unit: str, image: bytes, base: int) -> None:
        """Put a program into memory."""
        self.do(Load(unit, image, base))

    def start(self, unit: str) -> None:
        """Start the program in memory."""
        self.do(Start(unit))

    def save(self, unit: str) -> int:
        """Send the unit its own command that keeps its program; how often it had written before."""
        index = self.history.cell.unit(unit)
        command = catalogue.model(self.history.cell.controller(unit).model).saves
        if not command:
            raise ValueError(f"{unit} has no memory that lasts without supply")
        written = self.history.panel.fronts[index].stored
        self.do(Type(unit, command))
        return written

    def read_back(self, unit: str, kept: bool) -> bytes:
        """What is in memory."""
        controller = self.history.cell.controller(unit)
        return controller.kept_memory() if kept else controller.program_memory()

    def breaks(self, given: Mapping[str, object]) -> int:
        """Something breaks, with the arguments of the verb `fault` of the control API; the number of the fault."""
        found = VERBS["fault"].read(given)
        lasting = found.get("for")
        assert lasting is None or isinstance(lasting, int)
        fault = breaking.fault_of(Names(self.history.cell), found)
        self.do(Break(fault, lasting))
        return self.history.cell.faults.last

    def mend(self, number: int | None) -> None:
        """A fault is mended; all of them without a number."""
        for one in list(self.history.cell.faults.standing) if number is None else [number]:
            self.do(Mend(one))

    def restart(self) -> None:
        """Begin anew from the cell file. ValueError if its lines are others now."""
        lines, standing = self.history.cell.wiring.line_names, self._pace.held
        found, before = self._find(), (self._found, self._stores, self.history, self._reports, self._views, self._marks)
        stops = {(self.history.cell.wiring.names[unit], address) for unit, address in self.history.breakpoints}
        cell = self._begin(found)
        if cell.wiring.line_names != lines:
            self._found, self._stores, self.history, self._reports, self._views, self._marks = before
            raise ValueError("the lines of the cell are others now: close the workbench and open it again")
        units = cell.wiring.names[: cell.wiring.units]
        self.history.breakpoints = {(units.index(unit), address) for unit, address in stops if unit in units}
        self._pace.go(self.now)
        if standing:
            self.hold()
        self._tell_all()
        self.watched.give_up()

    def do(self, action: Action) -> None:
        """Do it, now; what does not show itself gets its mark. Raises what `History.do` does."""
        self.history.do(action)
        self._marks.action(self.history.cell, action)
        self._quiet = False
        if self._pace.held:
            self._pace.hold(self.now)

    # -- verbs: what is sent while it stands -----------------------------------------------------------

    def _sends_now(self) -> bool:
        return not self._pace.held

    def queue_type(self, unit: str, text: str) -> None:
        """Send a unit a command line, or keep it until time goes on."""
        if self._sends_now():
            self.type(unit, text)
            return
        cell = self.history.cell
        line = cell.hosted_line(unit)
        cell.serial_unit(unit).frame(text)  # what it does not take is said now
        self.waiting.put(cell.wiring.line_names[line], unit, text)
        self._quiet = False

    def queue_send(self, line: str, data: bytes) -> None:
        """Send bytes to a line, or keep them until time goes on."""
        if self._sends_now():
            self.send_line(line, data)
            return
        names = self.history.cell.wiring.line_names
        if line not in names:
            raise catalogue.unknown("line", line, names)
        self.waiting.put(line, None, data.decode("latin-1"))
        self._quiet = False

    def withdraw(self, number: int | None) -> None:
        """Take back what waits: one, or all of it."""
        self.waiting.withdraw(number)
        self._quiet = False

    def send_waiting(self) -> None:
        """What has waited goes out; what is refused is raised, and what is behind it stays."""
        self.waiting.out(self._send)

    def _send(self, one: Waits) -> None:
        if one.unit is None:
            self.send_line(one.line, one.text.encode("latin-1"))
        else:
            self.type(one.unit, one.text)

    def refuse(self, error: Exception) -> None:
        """Tell the workbench that it was asked wrongly."""
        self._pipe.push(Failed(str(error), "", asked_wrongly=True))

    def fail(self, error: Exception) -> None:
        """Tell the workbench why there is an end."""
        trace = "".join(traceback.format_exception(error))
        self._pipe.push(Failed(f"{type(error).__name__}: {error}", trace, asked_wrongly=False))

    _VERBS: ClassVar[dict[str, Callable[..., object]]] = {
        verb.__name__: verb
        for verb in (hold, go, step_event, step_instruction, step_back, rewind, run_to_address, alarm, set_breakpoints,
                     set_breakpoint,
                     take_branch, compare_branch,
                     set_break_on_errors, power, set_switch, set_pin, place_switch, send_line, type, load, start, save,
                     breaks, mend, queue_type, queue_send, withdraw,
                     read_back, restart)
    } | {"pace": change_pace}  # fmt: skip
