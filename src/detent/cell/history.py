"""A cell with its past: it can be gone back to any moment that is kept, and goes on from there.

Copies of the cell (`Moment`) are kept from time to time, the farther back the fewer; between them the cell is run again
with what was done to it, and does the same again. Going back and looking loses nothing: what lies ahead, up to the
present, stays until the cell goes on from its past (`go`, or any action); then that is dropped, and hosts and hands do
what comes now. Hosts hear nothing twice, and non-volatile memories are not written twice (`stores`); when a past is
gone on from, they are written back to what they were then.
"""

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress

import numpy as np

from detent.cell.actions import Action, Send, TimedAction
from detent.cell.cell import Cell
from detent.cell.circuit import Oscillation
from detent.cell.mechanics import Mechanics
from detent.cell.moments import Branch, Cut, Moment, News, PausedLine
from detent.cell.panel import Panel
from detent.cell.recording import Batch, Entry
from detent.cell.stores import Stores
from detent.controllers.device import Executing, Refused
from detent.lines.line import Line
from detent.motors.motor import MotorError
from detent.motors.rotor import Floats
from detent.ticks import MS, SECOND, Ns
from detent.uart import Chars

MOST_MOMENTS = 200
MOST_BRANCHES = 20  # futures that were left, and can be taken again
KEEP = 400_000  # batches of the recording that can be gone back over
EVERY = 1_000  # units of work between two moments
SOONER = 50  # units of work that are enough when a second has passed
ROTOR_WORK: Ns = 10 * MS  # computing a motor for so long is a unit of work, like a batch
PATIENCE: Ns = 60 * SECOND  # how long a step waits for the next instruction
MOST_EVENTS = 200_000  # likewise
MOST_WAITING = 50_000  # batches that nobody has asked for: then a cell that runs as fast as it goes waits

FAULTS = (Oscillation, MotorError, AssertionError, ArithmeticError, IndexError, AttributeError, RecursionError)
"""What an action makes a cell raise that cannot go on; other errors say that the action is none."""

Address = tuple[int, int]
"""A unit, by its number, and a byte of its program memory."""


class Broken(RuntimeError):
    """The cell cannot go on from where it stands: only back. The text says why."""


class History:
    """A cell that records, as it was built with `stores.save`, with its past from now on. It is served like a cell.

    While `stopped` says why, time does not go on. `shafts` are the places where axes stood before anything was
    recorded, if not at 0. `keep` batches of the recording, at least, can be gone back over.
    """

    def __init__(
        self,
        cell: Cell,
        stores: Stores | None = None,
        *,
        shafts: Mapping[str, int] | None = None,
        keep: int = KEEP,
        on_stop: Callable[[], None] = lambda: None,
    ) -> None:
        """ValueError for a cell that does not record."""
        if cell.recording is None:
            raise ValueError("this cell keeps no recording, so it has no past: build it with record=True")
        cell.journaling = False  # actions are kept here
        self._stores, self._keep, self._on_stop = stores or Stores(), keep, on_stop
        self._here = Moment(cell, Panel(cell, shafts or {}))
        self._present: Moment | None = None  # None: that is where the cell stands
        self.motors = [k for k, part in enumerate(cell.parts) if isinstance(part, Mechanics)]  # by their number
        self._actions: list[TimedAction] = []
        self._first_action = 0  # the number of the first that is kept
        self._told = self._told_actions = 0  # batches and actions that `news` has told
        self._fresh: list[Batch] = []
        self._cut: Cut | None = None
        self._paused_lines: list[PausedLine] = []  # the lines, in the past
        self._pending: list[Send] = []  # what hosts had sent already when the present was left
        self.stopped = ""
        self.breakpoints: set[Address] = set()
        self.once: Address | None = None  # a breakpoint that is gone when it is met
        self.break_on_errors = False
        self.on_notable: Callable[[int, Entry], None] = lambda unit, entry: None
        self._branches: list[Branch] = []
        self._branched = 0  # how many there were
        self._moments: list[Moment] = []
        self._look()
        self._moments.append(self._here.copy())

    # -- as it is served ---------------------------------------------------------------------------------

    @property
    def cell(self) -> Cell:
        """The cell where it stands. To look at: actions go through `do`."""
        return self._here.cell

    @property
    def panel(self) -> Panel:
        """The panels of its units, there."""
        self._look()
        return self._here.panel

    @property
    def now(self) -> Ns:
        """Where it stands."""
        return self._here.cell.now

    @property
    def begin(self) -> Ns:
        """How far it can go back."""
        return self._moments[0].now

    @property
    def end(self) -> Ns:
        """The present: the end of everything that has happened."""
        return (self._present or self._here).now

    @property
    def past(self) -> bool:
        """Whether it stands before the present."""
        return self._present is not None

    @property
    def untold(self) -> int:
        """Batches that nobody has asked for."""
        return len(self._fresh)

    @property
    def lines(self) -> Sequence[Line | PausedLine]:
        """The lines; in the past they are deaf, and hosts wait."""
        return self.cell.lines if self._present is None else self._paused_lines

    def next_event(self) -> Ns | None:
        """When something happens next by itself; None while it is stopped, or nobody asks for the news."""
        self._look()
        if self.stopped or self._present is not None or len(self._fresh) > MOST_WAITING:
            return None
        return self.cell.next_event()

    def run_to(self, until: Ns) -> None:
        """Let everything happen up to and including `until`, or up to the instant that stops it."""
        self._look()
        if self.stopped or self._present is not None:
            return
        cell = self.cell
        try:
            while (at := cell.next_event()) is not None and at <= until:
                cell.step()
                self._look()
                if self.stopped:
                    return
            cell.run_to(until)
        except Exception as error:  # of a unit, whatever it is: the cell stops, and who serves it goes on
            self._break(error)

    def send(self, line: int, data: Chars) -> None:
        """The host of a line sends `data`, now; if it stands in its past, when it has left that."""
        sent = Send(line, data if isinstance(data, bytes) else tuple(data))
        if self._present is not None:
            self._pending.append(sent)
        else:
            with suppress(Broken):  # it is stopped, and says why
                self._do(sent)  # the host has its answer before anybody looks at it

    # -- what is done to it ------------------------------------------------------------------------------

    def do(self, action: Action) -> None:
        """Do it, now, and let everything happen that it makes due in this instant; the past ends here, if this is it.

        Raises what the action raises, and Broken.
        """
        self._do(action)
        self._look()

    def _do(self, action: Action) -> None:
        self._stand_here()
        cell = self.cell
        try:
            _perform(cell, action)
        except FAULTS as error:
            self._keep_action(action)
            self._break(error)
            raise Broken(self.broken) from error
        self._keep_action(action)

    @property
    def broken(self) -> str:
        """Why it cannot go on from where it stands; "" if it can."""
        return self._here.broken

    def stop(self, why: str) -> None:
        """Stand still."""
        self.once = None
        if not self.stopped:
            self.stopped = why
            self._on_stop()

    def journal(self) -> tuple[int, Sequence[TimedAction]]:
        """How many actions are forgotten, and those behind them, up to where it stands."""
        return self._first_action, self._actions[: self._here.actions - self._first_action]

    def go(self) -> None:
        """Time goes on; in the past, from there. Raises Broken."""
        self._stand_here()
        self.stopped = ""

    def _keep_action(self, action: Action) -> None:
        self._actions.append(TimedAction(self.now, action, outside=True))
        self._here.actions += 1

    def _stand_here(self) -> None:
        """Where it stands is the present: what lay behind is dropped."""
        self._look()
        if self.broken:
            raise Broken(self.broken)
        if self._present is None:
            return
        here, left, self._present = self._here, self._present, None
        self._keep_branches(here, left.now)
        for unit in self._stores.cut(here.writes):
            self._stores.write_back(unit, here.cell.controller(unit).kept_memory())
        del self._actions[here.actions - self._first_action :]
        self._moments = [m for m in self._moments if m.batches <= here.batches and m.now <= here.now]
        self._fresh = self._fresh[: max(here.batches - self._told, 0)]
        self._told, self._told_actions = min(self._told, here.batches), min(self._told_actions, here.actions)
        earlier = here.now if self._cut is None else min(here.now, self._cut.at)
        self._cut = Cut(earlier, self._told, self._told_actions)
        self._do_pending()

    def _do_pending(self) -> None:
        pending, self._pending = self._pending, []
        for sent in pending:
            self.send(*sent)

    def _break(self, error: Exception) -> None:
        kind = "" if isinstance(error, (Oscillation, MotorError)) else f"{type(error).__name__}: "
        self._here.broken = f"{kind}{error} (go back on the time line, or begin anew)"
        self._look()
        self.stop(self.broken)

    # -- going back and forth ----------------------------------------------------------------------------

    def rewind(self, at: Ns) -> None:
        """The cell is as it was at `at`, or at the nearest moment that is kept, everything of that instant included."""
        self._look()
        if at >= self.end:
            self._to_present()
            return
        at = max(at, self.begin)
        if at == self.now and not self.broken:
            return
        there = self._moments[bisect_right(self._moments, at, key=lambda m: m.now) - 1].copy()
        self._again(there, at)
        self._leave_present()
        self._here = there

    def step(self) -> bool:
        """Let the next instant happen in which something does. False if nothing is left to happen.

        In the past: the one that came next then, with what was done to the cell.
        """
        self._look()
        if self._present is None:
            if self.broken:
                raise Broken(self.broken)
            at = self.cell.next_event()
            if at is not None:
                self.stopped, before = "", self.stopped
                self.run_to(at)
                self.stopped = self.stopped or before
            return at is not None
        at = self._next_again(self._here)
        if at is None or at >= self._present.now:
            self._to_present()
        else:
            self._again(self._here, at)
        return True

    def step_instruction(self, unit: int) -> str:
        """Go on to the next instruction of a unit's program. Why it did not come, if it did not."""
        before, limit = self.panel.fronts[unit].executing, self.now + PATIENCE
        for _ in range(MOST_EVENTS):
            if not self.step():
                return "nothing more happens by itself"
            now = self.panel.fronts[unit].executing
            if now is not None and now is not before:
                return ""
            if self.broken or self.now > limit:
                break
        return f"no instruction for {(self.now - limit + PATIENCE) / SECOND:g} s"

    def step_back(self, unit: int | None = None) -> bool:
        """Go back to the last instant before this in which something happened; of a unit: an instruction began.

        False, and to the beginning, if there is none.
        """
        before = self.now
        for moment in reversed([m for m in self._moments if m.now < before]):
            found = self._last_instant(moment, before, unit)
            if found is not None:
                self.rewind(found)
                return True
            before = moment.now + 1
        self.rewind(self.begin)
        return False

    def _last_instant(self, moment: Moment, before: Ns, unit: int | None) -> Ns | None:
        again, found = moment.copy(), None
        while (at := self._next_again(again)) is not None and at < before:
            self._again(again, at)
            executing = None if unit is None else again.panel.fronts[unit].executing
            if unit is None or (executing is not None and executing.at == at):
                found = at
        if found is None and unit is None and moment.now < before and moment is not self._moments[0]:
            return moment.now  # something happened there, or it would not be kept
        return found

    def _next_again(self, moment: Moment) -> Ns | None:
        """When something happened next, by itself or because it was done."""
        at = moment.cell.next_event()
        place = moment.actions - self._first_action
        action = self._actions[place].at if place < len(self._actions) else None
        return min((each for each in (at, action) if each is not None), default=None)

    def _again(self, moment: Moment, until: Ns, before: int | None = None) -> None:
        """What happened up to `until` happens again, to this copy; nobody outside hears of it.

        Only actions `before` that number, if there is one, are done.
        """
        cell, stores = moment.cell, self._stores
        writes, stores.writes = stores.writes, moment.writes
        last = None if before is None else max(before - self._first_action, 0)
        for action in self._actions[moment.actions - self._first_action : last]:
            if action.at > until:
                break
            cell.run_to(action.at)
            _perform(cell, action.what)
            moment.actions += 1
        cell.run_to(until)
        batches = _taken(cell)
        moment.batches += len(batches)
        moment.panel.take(batches)
        moment.writes, stores.writes = stores.writes, writes
        for line in cell.lines:
            line.take()
        for index in self.motors:
            take_trace(cell, index)

    def _leave_present(self) -> None:
        if self._present is None:
            self._here.writes = self._stores.writes
            self._present = self._here
            self._paused_lines = [PausedLine(line.take()) for line in self._here.cell.lines]

    def _to_present(self) -> None:
        if self._present is not None:
            self._here, self._present = self._present, None
            self._stores.writes = self._here.writes
            for line, deaf in zip(self.cell.lines, self._paused_lines, strict=True):
                line.heard[:0] = deaf.heard
            self._do_pending()

    # -- futures that were left ---------------------------------------------------------------------------

    def _keep_branches(self, here: Moment, end: Ns) -> None:
        """What comes after `here`, as far as `end`, is left; and so is what began there of futures left before."""
        gone = tuple(self._actions[here.actions - self._first_action :])
        kept = []
        for branch in self._branches:
            if branch.at > here.now or branch.first > here.actions:
                way = (*gone[: branch.first - here.actions], *branch.actions)
                branch = branch._replace(at=here.now, actions=way, first=here.actions)
            kept.append(branch)
        if end > here.now:
            self._branched += 1
            kept.append(Branch(self._branched, here.now, end, gone, here.actions))
        self._branches = kept[-MOST_BRANCHES:]

    def _fork(self, branch: Branch) -> Moment:
        """A copy of the cell where that future was left."""
        before = next(m for m in reversed(self._moments) if m.now <= branch.at and m.actions <= branch.first).copy()
        self._again(before, branch.at, branch.first)
        return before

    @property
    def branches(self) -> Sequence[Branch]:
        """Futures that were left and can be taken again, the oldest first: of places that can still be gone back to."""
        return [branch for branch in self._branches if self._reaches(branch)]

    def _reaches(self, branch: Branch) -> bool:
        first = self._moments[0]
        return first.now <= branch.at and first.actions <= branch.first

    def branch(self, number: int) -> Branch:
        """The future of that number. Raises KeyError."""
        for branch in self.branches:
            if branch.number == number:
                return branch
        raise KeyError(f"there is no other future {number}")

    def leave_for(self, number: int) -> Branch:
        """Stand where that future was left, as the present: what comes after is kept as one more. Raises KeyError."""
        branch = self.branch(number)
        self._look()
        there = self._fork(branch)
        self._leave_present()
        self._here = there
        self._stand_here()
        return branch

    def follow(self, branch: Branch) -> None:
        """From where it was left, do what was done then, up to its end. Hosts hear nothing of it."""
        stops, self.breakpoints = self.breakpoints, set()
        errors, self.break_on_errors = self.break_on_errors, False
        self.stopped = ""
        for action in (*branch.actions, None):
            self.run_to(branch.end if action is None else action.at)
            if action is not None:
                with suppress(Broken, ValueError, KeyError):  # as it was then
                    self.do(action.what)
        for line in self.cell.lines:
            line.take()
        self.breakpoints, self.break_on_errors = stops, errors
        self._branches = [other for other in self._branches if other.number != branch.number]

    def both(self, number: int) -> tuple[Moment, Moment]:
        """The cell at the end of that future, or of what has happened if that is earlier: there, and here."""
        branch = self.branch(number)
        until, there = min(branch.end, self.end), self._fork(branch)
        here = there.copy()
        actions, first = self._actions, self._first_action
        self._actions, self._first_action, self._stores.idle = list(branch.actions), branch.first, True
        try:
            self._again(there, until)
        finally:
            self._actions, self._first_action, self._stores.idle = actions, first, False
        self._again(here, until)
        return there, here

    # -- what happened -----------------------------------------------------------------------------------

    def news(self) -> News:
        """What happened since the last call, the past gone through again apart. `cut` comes before the rest."""
        self._look()
        cut, first = self._cut, self._told
        batches, self._fresh = self._fresh, []
        actions = self._actions[self._told_actions - self._first_action :]
        self._told, self._told_actions, self._cut = first + len(batches), self._told_actions + len(actions), None
        return News(cut, first, batches, actions)

    @property
    def first_batch(self) -> int:
        """The number of the first batch behind `begin`."""
        return self._moments[0].batches

    def _look(self) -> None:
        """Take over what the cell has recorded, stop where it was to stop, and keep a copy from time to time."""
        here = self._here
        if self._present is not None:
            return
        batches = _taken(here.cell)
        if not batches:
            return
        here.batches += len(batches)
        self._fresh += batches
        for unit, entry in here.panel.take(batches):
            self.on_notable(unit, entry)
            if isinstance(entry, Executing):
                place = unit, entry.address
                if place in self.breakpoints or place == self.once:
                    name = here.cell.wiring.names[unit]
                    self.stop(f"{name} has come to {entry.instruction} at {entry.address}")
            elif isinstance(entry, Refused) and self.break_on_errors:
                self.stop(f"{here.cell.wiring.names[unit]} refused {entry.frame!r}: {entry.reason}")
        if self._moments:
            self._keep_moment()

    def _keep_moment(self) -> None:
        here, last = self._here, self._moments[-1]
        work = self._work(here) - self._work(last)
        if work < EVERY and (work < SOONER or here.now - last.now < SECOND):
            return
        here.writes = self._stores.writes
        self._moments.append(here.copy())
        if len(self._moments) > MOST_MOMENTS:
            self._thin_out()
        if here.batches - self._moments[0].batches > self._keep:
            self._forget()

    def _work(self, moment: Moment) -> int:
        """What it costs to come there from the beginning, about."""
        return moment.batches + moment.now // ROTOR_WORK * len(self.motors)

    def _thin_out(self) -> None:
        """Drop the moment that is missed least: whose gap would be small for how long ago it is."""
        work = np.array([self._work(moment) for moment in self._moments], np.float64)
        gaps, ages = work[2:] - work[:-2], work[-1] - work[1:-1] + EVERY
        del self._moments[int(np.argmin(gaps / ages)) + 1]

    def _forget(self) -> None:
        """Drop the beginning."""
        while len(self._moments) > 1 and self._here.batches - self._moments[1].batches >= self._keep:
            del self._moments[0]
        first = self._moments[0]
        self._stores.forget(first.writes)
        gone = min(first.actions, self._told_actions) - self._first_action
        del self._actions[:gone]
        self._first_action += gone


def _perform(cell: Cell, action: Action) -> None:
    """Do it, and let everything of this instant happen."""
    cell.do(action)
    cell.run_to(cell.now)


def _taken(cell: Cell) -> list[Batch]:
    assert cell.recording is not None
    return cell.recording.take()


def take_trace(cell: Cell, part: int) -> list[Floats]:
    """The rows of a motor's trace since the last call."""
    mechanics = cell.parts[part]
    assert isinstance(mechanics, Mechanics)
    assert mechanics.trace is not None
    return mechanics.trace.take()
