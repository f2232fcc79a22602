"""A cell with everything it needs to be served: its endpoints opened, its images in possession, its loop."""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import AbstractContextManager
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import NamedTuple, TypeVar

from detent.cell.actions import Action, TimedAction
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.circuit import Oscillation
from detent.cell.description import Description, Problem
from detent.cell.mechanics import Mechanics
from detent.cell.outside import Store, no_store
from detent.cell.real_pins import behind_pins
from detent.controllers import catalogue
from detent.motors.motor import MotorError
from detent.pins import Level
from detent.realtime.boards.drive import Opened, RealPins
from detent.realtime.boards.driven import Driven
from detent.realtime.boards.replies import HeldStores
from detent.realtime.endpoints.endpoint import Endpoint, EndpointError, descriptors_suffice
from detent.realtime.endpoints.opened import Openings
from detent.realtime.endpoints.returning import Returning
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.endpoints.unsettling import Unsettling
from detent.realtime.guarded import Guarded, GuardedCompanion
from detent.realtime.images import Images
from detent.realtime.loop import BEHIND, Loop, Timer, stopped_by_signals, wake_exactly
from detent.realtime.pace import LatenessSummary, Pace
from detent.realtime.verbs import Answer
from detent.realtime.waiting import Watched
from detent.realtime.watch import RecentLog, Watch
from detent.ticks import Ns
from detent.uart import Format

T = TypeVar("T")


class Served(NamedTuple):
    """An endpoint that is open: the unit it leads to (of several: the name of their line), kind, address."""

    unit: str
    kind: str
    address: str
    form: Format


class Service:
    """A cell that is ready to be served. Close it, or use it as a context manager."""

    def __init__(
        self,
        description: Description,
        read: Callable[[str], str],
        endpoints: Sequence[EndpointSpec] = (),
        *,
        pace: Fraction | float = 1,
        line_timing: bool = True,
        images: Images | None = None,
        observed: bool = False,
        on_stop: Callable[[str], None] = lambda why: None,
        real: RealPins | None = None,
        timers: Sequence[Timer] = (),
        on_wire: Callable[[str], None] | None = None,
    ) -> None:
        """Build the cell and open `endpoints` for every line; nothing: what the cell file says, or the usual one.

        `images` stay their owner's. One that is `observed` can be looked at and meddled with (`realtime.control`).
        `on_stop` is told when the cell cannot go on; it is served all the same. With `real` it drives the boards of its
        cell file. `timers` are called by the loop. With `on_wire` serial ports may go and come back, and it is told;
        without, one that is lost ends the service. Raises Problem, EndpointError, ValueError.
        """
        self.description = description
        self.driven: Driven | None = None
        self.reports: list[str] = []  # about images that could not be used, and what a real cell would not stand
        ends = [line.endpoint for line in description.lines.values() if line.endpoint and not endpoints]
        if any(w.kind == "serial" for w in endpoints) or (ends and all(end.startswith("serial:") for end in ends)):
            line_timing = False  # the wire outside takes the time
        if real is not None and pace != 1:
            raise Problem("", "pace", "real pins keep real time: leave the pace at 1")
        self._company = contextlib.ExitStack()
        self._cleanup = contextlib.ExitStack()
        with descriptors_suffice(), contextlib.ExitStack() as opening:
            stores, inputs, opened = None, None, None
            if real is not None:
                opened = Opened(description, read, real)
                self.description = description = behind_pins(description)
                opening.callback(opened.boards.close)
                stores, inputs = HeldStores(no_store if images is None else images.save), opened.inputs
            self.cell = build_with_images(
                description, read, images, line_timing, self.reports, observed or real is not None,
                None if stores is None else stores.save, inputs,
            )  # fmt: skip
            self.reports += self.cell.wiring.remarks
            self._observed = observed
            if observed:
                observe(self.cell, passes_on=real is not None)
            if opened is not None and stores is not None:
                self.driven = opened.drive(self.cell, stores)
                opening.callback(opened.end, self.driven)
            self._to_begin = opened
            self._opened = open_endpoints(description, self.cell, endpoints, opening, on_wire=on_wire)
            self.endpoints = [
                Served(self._title(number), endpoint.kind, endpoint.address, self.cell.lines[number].format)
                for number, endpoint in self._opened
            ]
            clock = time.monotonic_ns if self.driven is None else self.driven.clock
            self.pace = Pace(pace, origin=self.cell.now, clock=clock)
            patience = [line.format.duration(BEHIND) for line in self.cell.lines]
            self.watched = Watched(self.driven or self.cell, self.pace) if observed else None
            self.guarded = Guarded(self.watched or self.driven or self.cell, self._stopped)
            self._on_stop = on_stop
            companion = None if self.driven is None else GuardedCompanion(self.driven, self.guarded)
            self._loop = Loop(self.guarded, self.pace, self._opened, patience=patience, companion=companion,
                              timers=timers)  # fmt: skip
            opening.callback(self._loop.close)
            self._cleanup = opening.pop_all()

    @property
    def watch(self) -> Watch | None:
        """How the units stand, of one that is observed. A cell that is taken back takes it along: ask each time."""
        recording = self.cell.recording
        return recording if self._observed and isinstance(recording, Watch) else None

    def ask(self, function: Callable[[], T]) -> "Future[T]":
        """Call `function` soon on the thread that serves; from any thread. Cancelled when the service is closed."""
        return self._loop.ask(lambda: self._asked(function))

    @property
    def stopped(self) -> str:
        """Why the cell stands and cannot go on; "" as long as it can."""
        return self.guarded.stopped

    def _asked(self, function: Callable[[], T]) -> T:
        try:
            return function()
        except (Oscillation, MotorError) as error:  # of the cell, which is no longer whole
            self.guarded.stop(error)
            raise

    def _stopped(self, why: str) -> None:
        if self.watched is not None:
            self.watched.close()  # nobody waits for what cannot happen
        if self.driven is not None:
            self.driven.abandon(why)
        self._on_stop(why)

    def ends_with(self, close: Callable[[], None]) -> None:
        """Call `close` before the service is closed."""
        self._company.callback(close)

    def addresses(self) -> list[tuple[int, str, str]]:
        """Each endpoint: the number of its line, its kind, and what a client connects to."""
        return [(line, endpoint.kind, endpoint.address) for line, endpoint in self._opened]

    def restart_clock(self) -> None:
        """The present of the cell is now: what it did before was done in virtual time."""
        if self.driven is None:
            self.pace.restart(self.cell.now)
        elif self._to_begin is not None:
            self._to_begin.begin(self.driven, self.pace)
            self._to_begin = None

    def run(self) -> None:
        """Serve until `stop`, also one that was called already. Raises EndpointLost."""
        wake_exactly()
        self.restart_clock()  # the time since the cell was made was ours, not the cell's
        self._loop.run()

    @contextlib.contextmanager
    def in_thread(self) -> Iterator[None]:
        """Serve in a thread of its own, until the end of the block."""
        thread = threading.Thread(target=self.run, name="detent", daemon=True)
        thread.start()
        try:
            yield
        finally:
            self.stop()
            thread.join()

    def stopped_by_signals(self) -> AbstractContextManager[None]:
        """SIGTERM, SIGINT and SIGHUP call `stop` while this lasts. For the main thread."""
        return stopped_by_signals(self._loop)

    def step(self) -> None:
        """Wait until there is something to do, then do it."""
        self._loop.step()

    def stop(self) -> None:
        """End `run` soon; from any thread."""
        self._loop.stop()

    def journal(self) -> tuple[int, Sequence[TimedAction]]:
        """How many actions are forgotten, and those behind them."""
        return self.cell.journal.forgotten, list(self.cell.journal)

    def standing(self) -> Answer:
        """Of its time nothing else is to be said."""
        return {}

    def do(self, action: Action) -> None:
        """Do it, now. Raises what `Cell.do` does."""
        self.cell.do(action)

    def stand(self) -> None:
        """Its time stands."""
        if not self.pace.held:
            self.pace.hold(self.cell.now)

    def go(self) -> None:
        """Its time goes on."""
        if self.pace.held:
            self.pace.go(self.cell.now)

    def present(self) -> None:
        """It has no past in which it could stand."""

    def step_event(self) -> None:
        """The next eventful instant; then it stands."""
        self.cell.step()
        self.pace.hold(self.cell.now)

    def run_on(self, until: Ns) -> bool:
        """Go on towards `until`, as fast as it can. Raises what the cell does."""
        self.cell.run_to(until)
        return True

    def change_pace(self, factor: float | None) -> None:
        """So many times as fast as real time; None: free. Raises ValueError."""
        self.pace.change(factor, self.cell.now)

    def lateness(self) -> LatenessSummary:
        """How late the deadlines of the cell were served."""
        return self.pace.lateness.summary()

    def dropped(self) -> int:
        """Bytes that were lost because clients did not read them."""
        return sum(endpoint.dropped for _, endpoint in self._opened)

    def close(self) -> None:
        """Close the endpoints, remove their links. May be called twice."""
        self._company.close()
        if self.watched is not None:
            self.watched.close()
        self._cleanup.close()

    def __enter__(self) -> "Service":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _title(self, line: int) -> str:
        wiring = self.cell.wiring
        units = [unit for unit, _ in wiring.lines[line]]
        return wiring.names[units[0]] if len(units) == 1 else wiring.line_names[line]


def models(description: Description) -> dict[str, str]:
    """The units of a cell with their models' names, as `Images` takes them."""
    return {name: unit.model for name, unit in description.units.items()}


def observe(cell: Cell, *, passes_on: bool) -> Watch:
    """A watch in the place of the recording of `cell`. The past is not kept, and of the journal what is recent."""
    watch = Watch(cell, passes_on=passes_on)
    cell.recording, cell.journal = watch, RecentLog()
    for part in cell.parts:
        if isinstance(part, Mechanics):
            part.trace = None
    return watch


def open_endpoints(
    description: Description,
    cell: Cell,
    endpoints: Sequence[EndpointSpec],
    opening: contextlib.ExitStack,
    *,
    placed: Mapping[str, Sequence[EndpointSpec]] | None = None,
    link: Callable[[str], Path] | None = None,
    on_wire: Callable[[str], None] | None = None,
) -> list[tuple[int, Endpoint]]:
    """Open `endpoints` for every line, with the line's number; nothing: what the cell file says, or the usual one.

    `placed` says it for lines by name instead: those of a service before this one. A pty that nobody has given a place
    gets the `link` for its line, if that can be had. With `on_wire` serial ports may go and come back, and it is told.
    `opening` closes them. Raises Problem, EndpointError, ValueError.
    """
    names = cell.wiring.line_names
    if not names:
        raise Problem(description.file, "units", "there is no unit with a serial line to serve")
    outside = [number for number, line in enumerate(cell.lines) if not line.hosted]
    opened: list[tuple[int, Endpoint]] = []
    openings, unsettling = Openings(), Unsettling()
    for place, number in enumerate(outside):
        name = names[number]
        found = placed.get(name) if placed else None
        for one in found or _for_line(description, endpoints, place, name, len(outside)):
            line = cell.lines[number]
            units = [description.units[cell.wiring.names[unit]].model for unit, _ in cell.wiring.lines[number]]
            echoes = any(model.echoes for name, model in catalogue.MODELS.items() if name in units)
            endpoint: Endpoint | None = None
            if one == EndpointSpec("pty") and link is not None:
                with contextlib.suppress(EndpointError, OSError):  # another has it: then without
                    there = link(name)
                    there.parent.mkdir(parents=True, exist_ok=True)
                    endpoint = EndpointSpec("pty", str(there)).open(
                        name, line.format, line.parting, echoes=echoes, openings=openings, unsettling=unsettling
                    )
            if endpoint is None:
                again = partial(
                    one.open, name, line.format, line.parting, echoes=echoes, openings=openings, unsettling=unsettling
                )
                endpoint = again() if on_wire is None or one.kind != "serial" else Returning(again, on_wire)
            opening.callback(endpoint.close)
            opened.append((number, endpoint))
    return opened


def _for_line(
    description: Description, endpoints: Sequence[EndpointSpec], number: int, name: str, lines: int
) -> Sequence[EndpointSpec]:
    """The endpoints of one line."""
    if endpoints:
        return endpoints if lines == 1 else [one.of_several(number, name) for one in endpoints]
    described = description.lines.get(name)
    if described is None or described.endpoint is None:
        return (EndpointSpec.usual(),)
    try:
        return (EndpointSpec.parse(described.endpoint),)
    except ValueError as error:
        raise Problem(description.file, f"lines.{name}.endpoint", str(error)) from None


def build_with_images(
    description: Description,
    read: Callable[[str], str],
    images: Images | None,
    line_timing: bool,
    reports: list[str],
    record: bool,
    store: Store | None = None,
    inputs: Mapping[tuple[str, str], Level] | None = None,
) -> Cell:
    """The cell with the images that are kept; an image that its controller cannot have written is moved aside."""
    if images is None:
        return build(
            description, read, store=store or no_store, record=record, line_timing=line_timing, inputs=inputs
        )  # fmt: skip
    kept: Mapping[str, bytes]
    kept, told = images.load()
    reports += told
    while True:
        try:
            save = store or images.save
            return build(
                description, read, images=kept, store=save, record=record, line_timing=line_timing, inputs=inputs
            )  # fmt: skip
        except Problem as problem:
            unit = problem.key.removeprefix("units.")
            if unit not in kept:
                raise
            kept = {name: image for name, image in kept.items() if name != unit}
            build(description, read, images=kept, record=False)  # raises if the image is not the trouble
            reports.append(images.set_aside(unit, problem.message))
