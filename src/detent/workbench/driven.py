"""The engine of a cell that drives real pins: the machine goes on, and the workbench looks at what is certain.

There are two cells. One is behind the pins (`realtime.boards.driven`): stops of the firmware take it back, so its last
moments may change. The other, with the past that windows look at, is built alike and lives through what was done to
the first when nothing can change it any more, some hundredths of a second later. Looking back stops the second only.
What a hand does is done to the first.
"""

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import ClassVar

from detent.cell.actions import Action, Release, SetPin
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.history import History
from detent.cell.outside import no_store
from detent.cell.real_pins import behind_pins, unreal
from detent.cell.stores import Stores
from detent.outputs.units import views
from detent.realtime.boards.certainty import CERTAIN
from detent.realtime.boards.drive import Opened, RealPins
from detent.realtime.boards.driven import Driven
from detent.realtime.boards.replies import HeldStores
from detent.realtime.boards.states import News, Severity, Standing
from detent.realtime.cell_source import CellSource
from detent.realtime.loop import Companion, ServedLine, stopped_by_signals, wake_exactly
from detent.realtime.pace import Pace, WallNs
from detent.realtime.service import build_with_images, observe
from detent.ticks import MS, Ns
from detent.uart import Chars
from detent.workbench import rotors
from detent.workbench.engine import Engine
from detent.workbench.marks import Marks
from detent.workbench.messages import RealState, State

EVERY: WallNs = 20 * MS  # between two looks at what is certain by now
SLICE: Ns = 5 * MS  # of the second cell, lived in one go
BUDGET: WallNs = 2 * MS  # what that may take each time: the pins come first
SPARE: Ns = 50 * MS  # beyond what is certain: a stop is seldom heard of later

LOOKING = "looking back; the machine goes on"
NOT_REAL = "real pins are driven: their time does not stand, wait or go back; STOP stops the motors"


class DrivenEngine(Engine):
    """A cell behind its pins, and its likeness with a past."""

    # -- made -------------------------------------------------------------------------------------------

    def _begin(self, found: CellSource) -> Cell:
        self._found, self._reports = found, list[str]()
        self._marks = Marks()
        self._shown: set[int] = set()
        read, images = found.read, self._images
        self._boards = opened = Opened(found.description, read, RealPins(self._news))
        self._found = found = found._replace(description=behind_pins(found.description))
        described = found.description
        self._opening.callback(opened.boards.close)
        stores = HeldStores(no_store if images is None else images.save)
        serial = any(spec.kind == "serial" for spec in self._order.endpoints)
        line_timing = self._order.line_timing and not serial
        real = build_with_images(
            described, read, images, line_timing, self._reports, True, stores.save, opened.inputs
        )  # fmt: skip
        if self._order.control is not None:
            observe(real, passes_on=True)
        self._reports += unreal(described, tuple(real.controllers()), driven=True)
        self._stores = Stores()
        cell = self._alike(found, line_timing)
        self._driven = opened.drive(real, stores)
        self._opening.callback(opened.end, self._driven)
        self._stale: Ns | None = None  # the machine was taken back to before what the second cell has lived through
        self._taken: deque[Ns] = deque()  # when each action was done, of those that both cells have
        self._count = 0  # of those that the machine's cell has, ever
        self._looked: WallNs = 0
        self._driven.rollback.on_taken_back = self._taken_back
        shafts = {name: unit.shaft for name, unit in described.units.items()}
        self.history = History(cell, self._stores, shafts=shafts, on_stop=lambda: None)
        self.history.on_notable = self._mark_entry
        for part in self.history.motors:
            rotors.prepare(cell, part)
        self._views = views(cell, shafts)
        return cell

    def _alike(self, found: CellSource, line_timing: bool) -> Cell:
        kept = {} if self._images is None else self._images.load()[0]
        return build(found.description, found.read, images=kept, store=self._stores.save, record=True,
                     line_timing=line_timing, inputs=self._boards.inputs)  # fmt: skip

    def _taken_back(self, at: Ns) -> None:
        if at < self.history.end:
            self._stale = at if self._stale is None else min(at, self._stale)

    def _made_pace(self) -> Pace:
        return Pace(1, origin=0, clock=self._driven.clock)

    def _companion(self) -> Companion:
        return self._driven

    def _again(self) -> None:
        """Nothing is done again: a machine has moved since."""

    def run(self) -> None:
        """Serve until the workbench leaves; from here on pulses leave. Raises EndpointLost."""
        wake_exactly()
        self._tell_all()
        self._boards.begin(self._driven, self._pace)
        with stopped_by_signals(self._loop):
            self._loop.run()

    # -- as it is served ---------------------------------------------------------------------------------

    @property
    def now(self) -> Ns:
        """The time of the machine's cell."""
        return self._driven.now

    @property
    def lines(self) -> Sequence[ServedLine]:
        """Its lines, which hold back what is not certain."""
        return self._driven.lines

    def next_event(self) -> Ns | None:
        """When something happens next by itself."""
        return self._driven.next_event()

    def run_to(self, until: Ns) -> None:
        """Let everything happen up to and including `until`."""
        self._driven.run_to(until)
        self._follow()

    def send(self, line: int, data: Chars) -> None:
        """The host of a line sends `data`, now."""
        self._driven.send(line, data)

    def _follow(self) -> None:
        """The second cell lives through what is certain by now, as far as time allows."""
        wall = time.monotonic_ns()
        history = self.history
        if history.past or history.stopped or wall - self._looked < EVERY:
            return
        self._looked = wall
        if self._stale is not None:
            at, self._stale = self._stale, None
            history.rewind(at)
            history.go()
            while self._taken and self._taken[-1] > history.now:
                self._taken.pop()
                self._count -= 1
        certain = self._driven.now - self._driven.plan.lead - self._driven.lag - CERTAIN - SPARE
        waiting = iter(self._driven.cell.journal.since(self._count))
        action = next(waiting, None)
        while history.now < certain and not history.stopped and time.monotonic_ns() - wall < BUDGET:
            until = min(history.now + SLICE, certain)
            if action is not None and action.at <= until:
                history.run_to(action.at)
                history.do(action.what)
                self._taken.append(action.at)
                self._count += 1
                action = next(waiting, None)
            else:
                history.run_to(until)
            for line in history.lines:
                line.take()  # its hosts hear the first cell
        self._quiet = False

    # -- what is told ------------------------------------------------------------------------------------

    def _state(self) -> State:
        """A look; what stands, if it does, is the view."""
        state = super()._state()
        units = {
            name: unit._replace(held_pins=frozenset(p for p in unit.held_pins if (name, p) not in self._boards.inputs))
            for name, unit in state.units.items()
        }
        return state._replace(held=bool(self.history.stopped), units=units)

    def _real_state(self) -> RealState:
        axes = self._driven.axes()
        at_fault = [axis for axis in axes if axis.standing is Standing.FAULT]
        why = list(dict.fromkeys(f"{'.'.join(filter(None, (a.unit, a.axis)))}: {a.why}" for a in at_fault))
        resting = self._driven.outputs_at_rest()
        if resting:
            why.append(f"at rest on their pins, whatever is shown: {', '.join(resting)}")
        standing = Standing.FAULT if at_fault else Standing.DRIVEN
        slips, stops = sum(axis.slips for axis in axes), sum(axis.stops for axis in axes)
        return RealState(standing.value, "; ".join(why), slips, stops)

    def _on_wire(self) -> Callable[[str], None]:
        """A machine goes on while its host is away."""
        return lambda text: self._news(News(self._driven.now, Severity.WARNING, text))

    def _news(self, news: News) -> None:
        kind = "action" if news.severity is Severity.NOTE else "error"
        self._marks.put(news.at, kind, news.text)
        self._quiet = False

    def _stopped(self) -> None:
        """The second cell stands: the machine goes on."""
        self._quiet = False

    # -- verbs -------------------------------------------------------------------------------------------

    def stop_motors(self) -> None:
        """Emergency stop."""
        self._driven.stop()
        self._quiet = False

    def recover(self) -> None:
        """Axes at fault go on from where their motors stand."""
        self._driven.recover()
        self._quiet = False

    def go(self) -> None:
        """Back to the present."""
        self.history.rewind(self.history.end)
        self.history.stopped = ""
        self._quiet = False

    def hold(self) -> None:
        """Only the view stands."""
        self.history.stopped = LOOKING
        self._quiet = False

    def _stand(self) -> None:
        self.hold()

    def rewind(self, at: Ns) -> None:
        """The cell as it was; at its end, the present."""
        if at >= self.history.end:
            self.go()
        else:
            super().rewind(at)

    def step_event(self) -> None:
        """The next event of the past."""
        if not self.history.past:
            raise ValueError(NOT_REAL)
        super().step_event()
        if not self.history.past:
            self.go()

    def refuse(self, *_: object) -> None:
        """What would make the machine's time another."""
        raise ValueError(NOT_REAL)

    def set_breakpoints(self, unit: str, addresses: Sequence[int]) -> None:
        """None: a machine does not stand at an instruction."""
        if addresses:
            raise ValueError(NOT_REAL)

    def set_breakpoint(self, unit: str, address: int, on: bool) -> None:
        """Nor can one be set."""
        if on:
            raise ValueError(NOT_REAL)

    def set_break_on_errors(self, on: bool) -> None:
        """Not on errors either."""
        if on:
            raise ValueError(NOT_REAL)

    def pace(self, factor: float | None) -> None:
        """Real time."""
        if factor != 1:
            raise ValueError(NOT_REAL)

    def do(self, action: Action) -> None:
        """Do it to the machine's cell, now, unless its past is looked at."""
        if self.history.past or self.history.stopped:
            raise ValueError("you are looking back: go to the present first, where the machine is")
        if isinstance(action, (SetPin, Release)) and (action.unit, action.pin) in self._boards.inputs:
            raise ValueError(f"{action.unit}.{action.pin} is an input of a board; its level is that of the pin")
        self.do_there(action)

    def do_there(self, action: Action) -> None:
        """Do it to the machine's cell, now, whatever is looked at."""
        self._driven.cell.do(action)
        self._driven.run_to(self._driven.now)
        self._marks.action(self._driven.cell, action)
        self._quiet = False

    def _sends_now(self) -> bool:
        """A machine's time always goes on: what is typed while somebody looks back must not move it later."""
        return True

    def _is_present(self) -> bool:
        """It is the machine that one waits for."""
        return True

    @property
    def driven(self) -> Driven:
        """The machine's cell behind its pins."""
        return self._driven

    _VERBS: ClassVar[dict[str, Callable[..., object]]] = {
        **Engine._VERBS,  # noqa: SLF001 (of its own kind)
        **{verb.__name__: verb for verb in (stop_motors, recover, go, hold, rewind, step_event, set_breakpoints,
                                            set_breakpoint, set_break_on_errors, pace)},
        **dict.fromkeys(("step_instruction", "run_to_address", "place_switch", "restart", "take_branch",
                         "compare_branch", "breaks", "mend"), refuse),
    }  # fmt: skip
