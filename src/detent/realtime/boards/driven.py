"""A cell that drives real pins: it stands between the loop and the cell, and between the cell and its boards.

Cell time is the board's time, and everything leaves a constant lead later. Only pulses that are certain are sent:
those of the cell's past. A stop in the firmware takes the cell back to the instant of the trigger: there it gets the
input, and lives through what follows once more. What cannot be taken back (replies, stored images) waits until it is
certain.
"""

import time
from collections.abc import Callable, Mapping, Sequence

from detent.cell.cell import Cell
from detent.pins import Level
from detent.realtime.boards.axis_ledger import AxisLedger
from detent.realtime.boards.board import State
from detent.realtime.boards.boards import Boards
from detent.realtime.boards.events import Stopped
from detent.realtime.boards.faults import Faults
from detent.realtime.boards.incoming import Incoming
from detent.realtime.boards.outgoing import Outgoing
from detent.realtime.boards.plan import Plan
from detent.realtime.boards.replies import HeldLine, HeldStores
from detent.realtime.boards.rollback import Rollback
from detent.realtime.boards.states import AxisState, BoardState, News, Severity, Standing
from detent.realtime.pace import Pace, WallNs
from detent.ticks import MS, NEVER, Ns
from detent.uart import Chars

SLACK: Ns = 200 * MS  # a host that was stalled hears of a stop so late
FORGET_EVERY: Ns = 50 * MS


class Driven:
    """`cell` behind its pins. It is served in the cell's place, and looks after the boards between two wake-ups.

    `outgoing` is what the cell does on its way to the boards; what comes back is dealt with by `incoming`, a stop by
    `rollback`, a failure by `faults`.
    """

    def __init__(
        self,
        cell: Cell,
        boards: Boards,
        plan: Plan,
        stores: HeldStores,
        *,
        wall: Callable[[], WallNs] = time.monotonic_ns,
        tell: Callable[[News], None] = lambda news: None,
    ) -> None:
        """The cell was built with `stores.save` as its store, records, and nothing has happened to it since.

        The boards are ready. `tell` is told, once each, what people should know.
        """
        self.cell, self.boards, self.plan, self._wall = cell, boards, plan, wall
        self.outgoing = Outgoing(cell, boards, plan, stores, wall, tell)
        self._faults = Faults(self.outgoing)
        self.rollback = Rollback(self.outgoing, self._faults)
        self._incoming = Incoming(self.outgoing, self._faults, self.rollback)
        self._looked: WallNs = 0
        self._due: WallNs | None = 0  # when the boards want to be looked after, as the loop was told
        self._forgotten: Ns = 0
        self.on_moving: Callable[[bool], None] = lambda moving: None  # something begins to move, or all is at rest
        self._was_moving = False
        self._stepped_by_pins: set[str] = set()  # units that are stepped by pulses on inputs with pins
        self.cut_short: frozenset[str] = frozenset()  # axes that moved when the end came
        self._over: WallNs | None = None  # since when their last steps have left

    def begin(self, pace: Pace, inputs: Mapping[str, Level]) -> None:
        """The cell's present is the boards' present; `inputs` are what the cell was built with."""
        self.outgoing.begin(pace, inputs)

    def align(self, pace: Pace) -> None:
        """The cell's present is now."""
        self.outgoing.clock.align(pace, self.cell.now)

    def clock(self) -> Ns:
        """The time for the pace of the cell: of the master board."""
        return self.outgoing.clock.now()

    @property
    def lines(self) -> Sequence[HeldLine]:
        """The lines as their hosts hear them."""
        return self.outgoing.lines

    @property
    def ledgers(self) -> Sequence[AxisLedger]:
        """The driven axes."""
        return self.outgoing.ledgers

    @property
    def lag(self) -> Ns:
        """How much later than the lead the pins are at present: the latest axis."""
        return self.outgoing.certainty.lag

    def outputs_at_rest(self) -> list[str]:
        """Outputs of units whose board has stopped or is gone, so that they have another level than in the cell."""
        boards, names = self.boards, self.plan.outputs.values()
        return [
            out.name
            for out in self.outgoing.outputs.values()
            if out.name in names
            and boards.boards[boards.home[out.name]].state is not State.READY
            and out.level is not boards.outputs[out.name].setup.off
        ]

    @property
    def abandoned(self) -> bool:
        """Whether the cell cannot go on, and nothing is done for it any more."""
        return self._faults.abandoned

    def stop(self) -> None:
        """Emergency stop: every board stops at once, and every axis stands until `recover`."""
        self._faults.stop()

    def abandon(self, why: str) -> None:
        """The cell cannot go on: every board stops at once, for good."""
        self._faults.abandon(why)

    def recover(self) -> list[str]:
        """Go on from where the motors stand: boards are made ready again. The axes whose board is waited for."""
        return self._faults.recover()

    @property
    def now(self) -> Ns:
        """The time of the cell."""
        return self.cell.now

    def next_event(self) -> Ns | None:
        """When something happens by itself."""
        return self.cell.next_event()

    def run_to(self, until: Ns) -> None:
        """Let everything happen up to `until`, and take note of it, and of what was done to the cell at its present."""
        cell = self.cell
        while (at := cell.next_event()) is not None and at <= until:
            cell.run_to(at)
            self.outgoing.instants += 1
            self.outgoing.absorb()
        cell.run_to(until)
        self.outgoing.absorb()

    def send(self, line: int, data: Chars) -> None:
        """The host of a line sends `data`, now."""
        self.cell.send(line, data)
        self.outgoing.absorb()

    def reading(self) -> Sequence[int]:
        """Descriptors that may have something to read."""
        return self.boards.reading()

    def writing(self) -> Sequence[int]:
        """Descriptors that wait for room."""
        return self.boards.writing()

    def receive(self, descriptor: int) -> None:
        """Something can be read."""
        self.boards.receive(descriptor, self._wall())

    def flush(self, descriptor: int) -> None:
        """Something can be written."""
        self.boards.flush(descriptor, self._wall())

    def deadline(self) -> Ns | None:
        """When `serve` is to be called at the latest, by `clock`."""
        wall, clock = self._wall(), self.clock()
        self._due = self.boards.deadline()
        times = [at for at in (self._due, self.boards.commit_at()) if at is not None]
        if self.outgoing.pending:
            times.append(self.outgoing.committed + self.boards.batch)
        at = clock + min(times) - wall if times else None
        self.outgoing.currents.look(self.ledgers)
        staged = self.outgoing.currents.next
        if staged <= self.cell.now:  # the boards were asked, and what they answer wakes it
            staged = self.cell.now + self.boards.batch
        cell = min(self._certain_at(), staged)
        if cell < NEVER:
            at = cell + self.outgoing.clock.offset if at is None else min(at, cell + self.outgoing.clock.offset)
        return at

    def _certain_at(self) -> Ns:
        """The cell time at which something that waits to be certain may be so; NEVER: nothing waits."""
        tail = min((ledger.guard.next for ledger in self.ledgers), default=NEVER)
        first = self.outgoing.held_since
        if min(tail, first) == NEVER:
            return NEVER
        behind = self.outgoing.certainty.behind  # what was said and stored before that is certain
        if first + behind <= self.cell.now and self.outgoing.certainty.horizon() < first:
            first = self.cell.now + self.boards.batch - behind  # the boards were asked, and what they answer wakes it
        return min(tail, first) + behind

    def serve(self) -> None:
        """The cell is at its present: deal with what came from the boards, and give them what is certain."""
        wall = self._wall()
        if self._due is not None and self._due <= wall:  # what came since may be due sooner: then it wakes the loop
            self.boards.due(wall, self._wall)
        if self.abandoned:
            self.boards.events()
            return
        events = self.boards.events()
        for event in events:
            self._incoming.happened(event)
        if events:
            self.outgoing.absorb()
        self.outgoing.certainty.inquire(self.outgoing.held_since, self.outgoing.currents.next)
        over = self.outgoing.stores.first < NEVER and self.outgoing.stores.first <= self.outgoing.certainty.horizon()
        if events or over or self.outgoing.currents.due or wall - self._looked >= self.boards.batch:
            self._looked = wall
            self._look()
        if (
            self.boards.starving
            or (self.outgoing.pending and wall - self.outgoing.committed >= self.boards.batch)
            or ((wanted := self.boards.commit_at()) is not None and wanted <= wall)
        ):
            self.outgoing.commit()
            for event in self.boards.events():
                self._incoming.happened(event)

    def _look(self) -> None:
        """What is over by now, and what is certain; and whether all is as it should be."""
        self.outgoing.refresh()
        if self.outgoing.currents.follow(self.ledgers):
            self.outgoing.pending = True
        self.rollback.not_stopped()
        self._prove()
        self._warn_of_step_inputs()
        if self.outgoing.stores.first < NEVER:
            self.outgoing.stores.flush(self.outgoing.certainty.horizon())
        if self.cell.now >= self._forgotten + FORGET_EVERY:
            self._forget()
        moving = any(
            ledger.motion is not None or ledger.guard.armed or not ledger.stepper.resting for ledger in self.ledgers
        )  # at the pins, too: until the last step a stop may take the cell back
        if moving is not self._was_moving:
            self._was_moving = moving
            self.on_moving(moving)

    def _prove(self) -> None:
        """At rest a stepper has been told of all pulses that the cell gave, and of no others: whatever befell it."""
        for ledger in self.ledgers:
            resting = ledger.motion is None and ledger.stepper.resting and ledger.awaits is None
            resting = resting and not self.boards.stops[ledger.name].firing
            if ledger.standing is Standing.DRIVEN and resting:
                sent, here = ledger.stepper.shaft, ledger.shaft_at(self.cell.now)
                if sent != here and not self.outgoing.pending:
                    self._faults.fault(ledger, f"{sent} steps were sent where the cell has {here}")
                    self._faults.place(ledger, sent)

    def _warn_of_step_inputs(self) -> None:
        """Say it where pulses on inputs with pins become steps: a board that looks at them now and then misses some."""
        for unit in {unit for unit, _ in self.plan.inputs.values()}:
            pins = [
                pin for pin in self.cell.controller(unit).step_inputs() if (unit, pin) in self.outgoing.inputs.name_of
            ]
            if pins and unit not in self._stepped_by_pins:
                what = "every pulse is a step now, and a board looks at its inputs once a millisecond"
                self.outgoing.say(Severity.WARNING, f"{unit}: on {', '.join(pins)} {what}: steps may be lost")
            (self._stepped_by_pins.add if pins else self._stepped_by_pins.discard)(unit)

    def _forget(self) -> None:
        self._forgotten = self.cell.now
        oldest = self.outgoing.past.forget(self.outgoing.certainty.until() - SLACK)
        if oldest is None:
            return
        counts = iter(oldest.counts)
        for ledger in self.ledgers:
            ledger.motions.forget(next(counts))
        for out in self.outgoing.outputs.values():
            out.levels.forget(next(counts))
        for _ in self.lines:
            next(counts)
        for ledger in self.ledgers:
            ledger.stages.forget(next(counts))
        self.outgoing.stores.forget(next(counts))

    def halt(self) -> None:
        """Whatever moves ends with the steps that have left. Nothing is lived through any more: `close` follows."""
        moving = [ledger for ledger in self.ledgers if ledger.motion is not None and ledger.standing is Standing.DRIVEN]
        self.cut_short = frozenset(ledger.name for ledger in moving)
        for unit in dict.fromkeys(ledger.what.unit for ledger in moving):
            self.cell.halt(unit)
        self.outgoing.absorb()
        self.outgoing.commit()

    def let_out(self) -> bool:
        """Behind `halt`, from time to time: whether the last step has left, and no switch that it met is untold."""
        wall = self._wall()
        for event in self.boards.events():
            if isinstance(event, Stopped):  # one of the last steps met a switch
                self.outgoing.by_stepper[event.stepper].stepper.rewind(event.shaft)
        self.boards.commit(self.cell.now, wall, self._wall)
        if not all(ledger.stepper.over(wall) for ledger in self.ledgers):
            return False
        self._over = wall if self._over is None else self._over
        self.boards.inquire(wall)
        heard = self.boards.heard()
        return heard is None or heard > self._over

    def close(self) -> None:
        """Let go: what is certain is stored, no step comes any more, and every output falls to its level at rest."""
        self.outgoing.stores.flush(NEVER)
        self.boards.emergency_stop(self._wall())
        self.on_moving(False)

    def ended(self) -> list[str]:
        """Where each axis stands, behind `close`: a line each for people."""
        told = []
        for ledger in self.ledgers:
            if ledger.standing is not Standing.DRIVEN:
                told.append(f"{ledger.name} stands: {ledger.why or 'it was not driven yet'}")
            else:
                where = f"{ledger.name} stands at {ledger.stepper.shaft}" + (
                    "" if ledger.known else " (not known for sure)"
                )
                cut = "; it was stopped in mid-move, without a ramp" if ledger.name in self.cut_short else ""
                told.append(where + cut)
        return told

    def axes(self) -> list[AxisState]:
        """How every driven axis stands."""
        now = self.cell.now
        return [
            AxisState(ledger.what.unit, ledger.what.axis, ledger.what.board, ledger.standing, ledger.why,
                      ledger.shaft_at(now), ledger.known, ledger.motion is not None, self.plan.lead, ledger.stepper.lag,
                      ledger.stepper.slips, ledger.stepper.slipped, ledger.stops, tuple(ledger.guard.armed))
            for ledger in self.ledgers
        ]  # fmt: skip

    def board_states(self) -> list[BoardState]:
        """How every board stands."""
        return [
            BoardState(name, board.state.value, board.firmware, board.frequency, board.move_count)
            for name, board in self.boards.boards.items()
        ]
