"""A cell that drives real pins: it stands between the loop and the cell, and between the cell and its boards.

Cell time is the board's time, and everything leaves a constant lead later. Only pulses that are certain are sent:
those of the cell's past. A stop in the firmware takes the cell back to the instant of the trigger: there it gets the
input, and lives through what follows once more. What cannot be taken back (replies, stored images) waits until it is
certain.
"""

from collections.abc import Sequence

from detent.realtime.boards.events import Stopped
from detent.realtime.boards.failures import Failures
from detent.realtime.boards.states import AxisState, BoardState, Standing, Weight
from detent.ticks import MS, NEVER, Ns
from detent.uart import Chars

SLACK: Ns = 200 * MS  # a host that was stalled hears of a stop so late
FORGET_EVERY: Ns = 50 * MS


class Driven(Failures):
    """`cell` behind its pins. It is served in the cell's place, and looks after the boards between two wake-ups.

    The cell was built with `stores.save` as its store, records, and nothing has happened to it since. The boards are
    ready. `tell` is told, once each, what people should know.
    """

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
            self._instants += 1
            self._absorb()
        cell.run_to(until)
        self._absorb()

    def send(self, line: int, data: Chars) -> None:
        """The host of a line sends `data`, now."""
        self.cell.send(line, data)
        self._absorb()

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
        if self._pending:
            times.append(self._committed + self.boards.batch)
        at = clock + min(times) - wall if times else None
        held = min((line.first for line in self.lines), default=NEVER)
        tail = min((ledger.guard.next for ledger in self.ledgers), default=NEVER)
        first = min(held, self._stores.first)
        if min(tail, first) == NEVER:
            return at
        behind = self._behind  # what was said and stored before that is certain
        if first + behind <= self.cell.now and self._horizon() < first:
            first = self.cell.now + self.boards.batch - behind  # the boards were asked, and what they answer wakes it
        cell = min(tail, first) + behind
        if cell < NEVER:
            at = cell + self._align if at is None else min(at, cell + self._align)
        return at

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
            self._happened(event)
        if events:
            self._absorb()
        self._inquire()
        over = self._stores.first < NEVER and self._stores.first <= self._horizon()
        if events or over or wall - self._looked >= self.boards.batch:
            self._looked = wall
            self._look()
        if (
            self.boards.starving
            or (self._pending and wall - self._committed >= self.boards.batch)
            or ((wanted := self.boards.commit_at()) is not None and wanted <= wall)
        ):
            self.commit()
            for event in self.boards.events():
                self._happened(event)

    def _look(self) -> None:
        """What is over by now, and what is certain; and whether all is as it should be."""
        self._refresh()
        self._currents()
        self._not_stopped()
        self._prove()
        self._warn_of_step_inputs()
        if self._stores.first < NEVER:
            self._stores.flush(self._horizon())
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
                if sent != here and not self._pending:
                    self._fault(ledger, f"{sent} steps were sent where the cell has {here}")
                    self._place(ledger, sent)

    def _warn_of_step_inputs(self) -> None:
        """Say it where pulses on inputs with pins become steps: a board that looks at them now and then misses some."""
        for unit in {unit for unit, _ in self.plan.inputs.values()}:
            pins = [pin for pin in self.cell.controller(unit).step_inputs() if (unit, pin) in self._input_of]
            if pins and unit not in self._stepped_by_pins:
                what = "every pulse is a step now, and a board looks at its inputs once a millisecond"
                self._say(Weight.WARNING, f"{unit}: on {', '.join(pins)} {what}: steps may be lost")
            (self._stepped_by_pins.add if pins else self._stepped_by_pins.discard)(unit)

    def _forget(self) -> None:
        self._forgotten = self.cell.now
        oldest = self.past.forget(self._certain() - SLACK)
        if oldest is None:
            return
        counts = iter(oldest.counts)
        for ledger in self.ledgers:
            ledger.motions.forget(next(counts))
        for out in self._outs.values():
            out.levels.forget(next(counts))
        for _ in self.lines:
            next(counts)
        self._stores.forget(next(counts))

    def halt(self) -> None:
        """Whatever moves ends with the steps that have left. Nothing is lived through any more: `close` follows."""
        moving = [ledger for ledger in self.ledgers if ledger.motion is not None and ledger.standing is Standing.DRIVEN]
        self.cut_short = frozenset(ledger.name for ledger in moving)
        for unit in dict.fromkeys(ledger.what.unit for ledger in moving):
            self.cell.halt(unit)
        self._absorb()
        self.commit()

    def let_out(self) -> bool:
        """Behind `halt`, from time to time: whether the last step has left, and no switch that it met is untold."""
        wall = self._wall()
        for event in self.boards.events():
            if isinstance(event, Stopped):  # one of the last steps met a switch
                self._by_stepper[event.stepper].stepper.rewind(event.shaft)
        self.boards.commit(self.cell.now, wall, self._wall)
        if not all(ledger.stepper.over(wall) for ledger in self.ledgers):
            return False
        self._over = wall if self._over is None else self._over
        self.boards.inquire(wall)
        heard = self.boards.heard()
        return heard is None or heard > self._over

    def close(self) -> None:
        """Let go: what is certain is stored, no step comes any more, and every output falls to its level at rest."""
        self._stores.flush(NEVER)
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
