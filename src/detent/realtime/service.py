"""A cell with everything it needs to be served: its endpoints opened, its images in possession, its loop."""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from fractions import Fraction
from typing import NamedTuple

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import Description, Problem
from detent.realtime.endpoints.endpoint import Endpoint
from detent.realtime.endpoints.wanted import Wanted
from detent.realtime.images import Images
from detent.realtime.loop import BEHIND, Loop, stopped_by_signals, wake_exactly
from detent.realtime.pace import LatenessSummary, Pace
from detent.uart import Format


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
        wanted: Sequence[Wanted] = (),
        *,
        pace: Fraction | float = 1,
        line_timing: bool = True,
        images: Images | None = None,
    ) -> None:
        """Build the cell and open what is `wanted` for every line; nothing: what the cell file says, or a pty.

        `images` stay their owner's. Raises Problem, EndpointError, ValueError.
        """
        self.reports: list[str] = []  # about images that could not be used
        if wanted and any(w.kind == "serial" for w in wanted):
            line_timing = False  # the wire outside takes the time
        self.cell = _build(description, read, images, line_timing, self.reports)
        names = self.cell.wiring.line_names
        if not names:
            raise Problem(description.file, "units", "there is no unit with a serial line to serve")
        outside = [number for number, line in enumerate(self.cell.lines) if not line.hosted]
        choices: list[Sequence[Wanted]] = [()] * len(names)
        for place, number in enumerate(outside):
            choices[number] = _for_line(description, wanted, place, names[number], len(outside))
        self.endpoints: list[Served] = []
        self._opened: list[tuple[int, Endpoint]] = []
        self._cleanup = contextlib.ExitStack()
        with contextlib.ExitStack() as opening:
            for number, choice in enumerate(choices):
                form = self.cell.lines[number].format
                for one in choice:
                    endpoint = one.open(names[number], form)
                    opening.callback(endpoint.close)
                    self._opened.append((number, endpoint))
                    served = Served(self._title(number), endpoint.kind, endpoint.address, form)
                    self.endpoints.append(served)
            self.pace = Pace(pace, origin=self.cell.now)
            patience = [line.format.duration(BEHIND) for line in self.cell.lines]
            self._loop = Loop(self.cell, self.pace, self._opened, patience=patience)
            opening.callback(self._loop.close)
            self._cleanup = opening.pop_all()

    def restart_clock(self) -> None:
        """The present of the cell is now: what it did before was done in virtual time."""
        self.pace.restart(self.cell.now)

    def run(self) -> None:
        """Serve until `stop`, also one that was called already. Raises EndpointLost, and what the cell raises."""
        wake_exactly()
        self.restart_clock()  # the time since the cell was made was ours, not the cell's
        self._loop.run()

    def stopped_by_signals(self) -> AbstractContextManager[None]:
        """SIGTERM, SIGINT and SIGHUP call `stop` while this lasts. For the main thread."""
        return stopped_by_signals(self._loop)

    def step(self) -> None:
        """Wait until there is something to do, then do it."""
        self._loop.step()

    def stop(self) -> None:
        """End `run` soon; from any thread."""
        self._loop.stop()

    def lateness(self) -> LatenessSummary:
        """How late the deadlines of the cell were served."""
        return self.pace.lateness.summary()

    def dropped(self) -> int:
        """Bytes that were lost because clients did not read them."""
        return sum(endpoint.dropped for _, endpoint in self._opened)

    def close(self) -> None:
        """Close the endpoints, remove their links. May be called twice."""
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


def _for_line(
    description: Description, wanted: Sequence[Wanted], number: int, name: str, lines: int
) -> Sequence[Wanted]:
    """The endpoints of one line."""
    if wanted:
        return wanted if lines == 1 else [one.of_several(number, name) for one in wanted]
    described = description.lines.get(name)
    if described is None or described.endpoint is None:
        return (Wanted("pty"),)
    try:
        return (Wanted.parse(described.endpoint),)
    except ValueError as error:
        raise Problem(description.file, f"lines.{name}.endpoint", str(error)) from None


def _build(
    description: Description,
    read: Callable[[str], str],
    images: Images | None,
    line_timing: bool,
    reports: list[str],
) -> Cell:
    """The cell with the images that are kept; an image that its controller cannot have written is moved aside."""
    if images is None:
        return build(description, read, record=False, line_timing=line_timing)
    kept: Mapping[str, bytes]
    kept, told = images.load()
    reports += told
    while True:
        try:
            return build(description, read, images=kept, store=images.save, record=False, line_timing=line_timing)
        except Problem as problem:
            unit = problem.key.removeprefix("units.")
            if unit not in kept:
                raise
            kept = {name: image for name, image in kept.items() if name != unit}
            build(description, read, images=kept, record=False)  # raises if the image is not the trouble
            reports.append(images.set_aside(unit, problem.message))
