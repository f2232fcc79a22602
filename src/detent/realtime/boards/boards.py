"""All boards of a cell: one is master of time, all are served together.

The first board is the master. Cell time is its time: a nominal second is so many of its own ticks, so that trains need
no scaling. Other boards get their ticks by regression: of their clocks on the wall clock, and of that on the master.
Their line is drawn anew every second: at rest where it should be, in motion from the tick at which it stands, to meet
the estimate two seconds later, so that no pulse jumps; later still where the clocks have parted, as a host slept.
"""

from collections.abc import Callable, Sequence

from detent.outputs.steps import Scale
from detent.realtime.boards.board import Board, State
from detent.realtime.boards.clock import Clock
from detent.realtime.boards.drivers import Driver
from detent.realtime.boards.events import Event
from detent.realtime.boards.lag import Lag, settle
from detent.realtime.boards.outputs import DigitalOut
from detent.realtime.boards.port import Port, PortLost
from detent.realtime.boards.setup import BoardSetup, SetupProblem
from detent.realtime.boards.stepper import Stepper
from detent.realtime.boards.stops import Stop
from detent.realtime.pace import WallNs
from detent.ticks import MS, SECOND, Ns

REOPEN_EVERY: WallNs = 250 * MS
REDRAW_EVERY: Ns = SECOND
MEETING: Ns = 2 * SECOND
AT_ONCE: WallNs = 1 * MS  # between two commits at least, where a change of an output is due
CATCHING_UP = 100  # by a hundredth of its speed at most: two clocks may have parted, and motors keep to their speed
FINER = 5  # bits of the fraction of a tick in the slope of another board


class Boards:
    """Boards with their ports. No call ever waits; `wall` is the host's monotonic clock, in ns.

    The owner watches `reading()` and `writing()`, calls `receive`, `flush`, and `due` at `deadline()`, runs its cell to
    the present, tells steppers and outputs what it did, and calls `commit` (at `commit_at()` too); then it looks at
    `events()`. `steppers`, `outputs`, `stops` and `drivers` are those of all boards, by name.
    """

    def __init__(self, boards: Sequence[tuple[BoardSetup, Port]]) -> None:
        """The first is the master of time. SetupProblem for what is wrong on any board."""
        if not boards:
            raise ValueError("there is no board")
        self._pairs = [(Board(setup), port) for setup, port in boards]
        self.boards: dict[str, Board] = {}
        self.steppers: dict[str, Stepper] = {}
        self.outputs: dict[str, DigitalOut] = {}
        self.stops: dict[str, Stop] = {}
        self.drivers: dict[str, Driver] = {}
        self.home: dict[str, str] = {}
        """The board of each stepper, output and driver, by name."""
        for board, _ in self._pairs:
            setup = board.setup
            if board.name in self.boards:
                raise SetupProblem(board.name, "", "there are two boards of that name")
            if setup.lead != boards[0][0].lead:
                raise SetupProblem(board.name, "lead", "all boards of a cell have the same lead, as what happens at "
                                   "the same time has to leave at the same time")  # fmt: skip
            for item in setup.items():
                if item.name in self.home:
                    raise SetupProblem(item.name, "", f"it is on {self.home[item.name]} and on {board.name}")
                self.home[item.name] = board.name
            self.boards[board.name] = board
            self.steppers |= board.steppers
            self.outputs |= board.outputs
            self.stops |= board.stops
            self.drivers |= board.drivers
        lags: dict[str, Lag] = {}
        for stepper in self.steppers.values():
            if stepper.setup.unit:
                stepper.shares(lags.setdefault(stepper.setup.unit, stepper.of))
        for out in self.outputs.values():
            if out.setup.unit in lags:
                out.shares(lags[out.setup.unit])
        self.master = self._pairs[0][0]
        self.lead: Ns = self.master.setup.lead
        self.batch: WallNs = self.master.setup.batch
        """Between two commits while something moves: more often makes more commands, not better pulses."""
        self._aligned: tuple[Ns, Ns] | None = None  # (cell time, board ns)
        self._redrawn: Ns = 0
        # a board that starts again has another clock: its time goes on where the old one stood
        self._clock: Clock | None = None  # of the master
        self._bias: Ns = 0  # what it is behind
        self._clocks: dict[str, Clock] = {}
        self._reopen_at: dict[str, WallNs] = {}
        self._committed: WallNs = 0

    # -- time

    def ns_at(self, wall: WallNs) -> Ns:
        """The master's time at `wall`, in its own nanoseconds; never less than what was answered before."""
        clock = self._clock or self.master.core.clock
        return clock.ns_at(wall) + self._bias

    def wall_at(self, board_ns: Ns) -> WallNs:
        """The first wall time at which the master's time is at least `board_ns`, as far as is known now."""
        clock = self._clock or self.master.core.clock
        return clock.wall_at_ns(board_ns - self._bias)

    def align(self, cell: Ns, board_ns: Ns) -> None:
        """Cell time `cell` is the master's time `board_ns`: everything begins, or goes on. Pins are a lead later.

        On another board that moves nothing jumps: its line is met again within a while.
        """
        self._aligned = cell, board_ns
        self._redrawn = cell
        frequency = self.master.frequency
        tick = (board_ns - self._bias + self.lead) * frequency // SECOND
        self.master.core.scale = Scale(frequency, SECOND, tick, cell)
        for board, _ in self._pairs[1:]:
            self._redraw(board, cell, self._committed)
        for stepper in self.steppers.values():
            stepper.rescale()

    def cell_at(self, wall: WallNs) -> Ns:
        """The cell time at `wall`. Only behind `align`."""
        assert self._aligned is not None
        return self._aligned[0] + self.ns_at(wall) - self._aligned[1]

    def wall_of(self, cell: Ns) -> WallNs:
        """The wall time at which the cell is at `cell`, as far as is known now. Only behind `align`."""
        assert self._aligned is not None
        return self.wall_at(self._aligned[1] + cell - self._aligned[0])

    def _new_clock(self, board: Board, wall: WallNs) -> None:
        """A board is ready, with a clock that was not known before."""
        clock = board.core.clock
        if self._clocks.get(board.name) is clock:
            return
        self._clocks[board.name] = clock
        if board is self.master:
            if self._clock is not None:
                self._bias += self._clock.ns_at(wall) - clock.ns_at(wall)
            self._clock = clock
        if self._aligned is None:
            return
        if board is self.master:
            self.align(self.cell_at(wall), self.ns_at(wall))
        else:
            self._draw(board, self.cell_at(wall), None)

    def _draw(self, board: Board, now: Ns, tick: int | None) -> None:
        """The line of cell time to ticks of another board from `now` on, where it is at `tick` (None: anywhere)."""
        clock = board.core.clock
        if not clock.known:
            return

        def at(cell: Ns) -> int:
            return clock.tick_at(self.wall_of(cell + self.lead))

        begin = at(now) if tick is None else tick
        meets, own = at(now + MEETING), at(now + MEETING) - at(now)
        most = own // CATCHING_UP
        slope = min(max(meets - begin, own - most), own + most) << FINER
        numerator = slope * SECOND // MEETING
        board.core.scale = Scale(numerator, SECOND << FINER, begin, now)

    def _redraw(self, board: Board, now: Ns, wall: WallNs) -> None:
        """The same, from where it is: pulses that have left have theirs, and no later one may come before them."""
        still = all(
            stepper.over(wall) or (stepper.stands(wall) is not None and not board.stops[name].alive)
            for name, stepper in board.steppers.items()
        )  # one that was told to move, and of which nothing has been sent, stands
        self._draw(board, now, None if still else board.core.scale.tick(now))

    # -- work

    def start(self, wall: WallNs) -> None:
        """Begin to talk; a `Ready` or `Refusal` comes from each."""
        for board, port in self._pairs:
            board.start(wall)
            self._pump(board, port, wall)

    @property
    def ready(self) -> bool:
        """Whether every board is."""
        return all(board.state is State.READY for board, _ in self._pairs)

    def commit(self, now: Ns, wall: WallNs, clock: Callable[[], WallNs] | None = None) -> None:
        """The cell has been run to `now` and everything it did was told: give the boards what is certain, at once.

        With a `clock` nothing leaves that has gone stale on the way: see `Board.commit`.
        """
        self._committed = wall
        if self._aligned is not None and now - self._redrawn >= REDRAW_EVERY:
            self._redrawn = now
            for board, _ in self._pairs[1:]:
                if board.state is not State.READY:
                    continue
                self._redraw(board, now, wall)
                for stepper in board.steppers.values():
                    stepper.rescale()
        if len(self._pairs) > 1:  # a unit on several boards is late on all of them
            settle([s for s in self.steppers.values() if self.boards[s.board].state is State.READY], now, wall)
        firm = min(board.firm for board, _ in self._pairs)
        for board, port in self._pairs:
            board.commit(now, wall, clock, firm)
            self._pump(board, port, wall)
            board.release_suppressed(wall)
            if clock is not None:
                wall = max(wall, clock())

    def commit_at(self) -> WallNs | None:
        """When `commit` is wanted though nothing new was told: pulses become certain, outputs fall due."""
        if self._aligned is None:
            return None
        soonest = self._committed + self.batch
        times: list[WallNs] = []
        changes: list[WallNs] = []  # of outputs; these have their times, and wait for no batch
        for board, _ in self._pairs:
            if board.state is not State.READY:
                continue
            changes += [at for out in board.outputs.values() if (at := out.pending_at()) is not None]
            for stepper in board.steppers.values():
                pulse = None if times and times[-1] <= soonest else stepper.next_pulse()
                if pulse is not None:
                    times.append(self.wall_of(pulse))
            if any(driver.waiting for driver in board.drivers.values()) or any(
                stop.pending for stop in board.stops.values()
            ):
                times.append(0)
        found = [max(min(times), soonest)] if times else []
        if changes:
            found.append(max(min(changes), self._committed + AT_ONCE))
        return min(found, default=None)

    @property
    def starving(self) -> bool:
        """Whether `commit` is wanted at once, sooner than a batch: what waited for room on the wire has it again."""
        return any(board.starving for board, _ in self._pairs)

    def heard(self) -> WallNs | None:
        """Whatever stops did up to this wall time was told; None: none can do anything."""
        return min((at for board, _ in self._pairs if (at := board.heard()) is not None), default=None)

    def inquire(self, wall: WallNs) -> None:
        """Have `heard` come on."""
        for board, port in self._pairs:
            board.inquire(wall)
            self._pump(board, port, wall)

    def events(self) -> list[Event]:
        """What came back since the last call, in order."""
        found: list[Event] = []
        for board, _ in self._pairs:
            found += board.core.events
            board.core.events.clear()
        return found

    def reading(self) -> Sequence[int]:
        """File descriptors to watch for something to read."""
        return [descriptor for _, port in self._pairs for descriptor in port.reading()]

    def writing(self) -> Sequence[int]:
        """File descriptors to watch for room to write."""
        return [descriptor for _, port in self._pairs for descriptor in port.writing()]

    def receive(self, descriptor: int, wall: WallNs) -> None:
        """`descriptor` has something to read."""
        for board, port in self._pairs:
            if descriptor in port.reading():
                self._read(board, port, wall)

    def flush(self, descriptor: int, wall: WallNs) -> None:
        """`descriptor` has room to write."""
        for board, port in self._pairs:
            if descriptor in port.writing():
                try:
                    port.flush()
                except PortLost as error:
                    self._gone(board, str(error), wall)

    def deadline(self) -> WallNs | None:
        """When `due` wants to be called, whatever else happens (retransmission, clock, watchdogs, a fake board)."""
        times = list(self._reopen_at.values())
        for board, port in self._pairs:
            times += [at for at in (board.deadline(), port.deadline()) if at is not None]
        return min(times, default=None)

    def due(self, wall: WallNs, clock: Callable[[], WallNs] | None = None) -> None:
        """It is `deadline`; may be called at any time. `clock` as for `commit`."""
        for board, port in self._pairs:
            at = port.deadline()
            if at is not None and wall >= at:
                self._read(board, port, wall)
            board.due(wall, clock)
            if board.state is State.READY:
                self._new_clock(board, wall)
            self._pump(board, port, wall)
            again = self._reopen_at.get(board.name)
            if again is not None and wall >= again:
                self._reopen(board, port, wall)

    def emergency_stop(self, wall: WallNs) -> None:
        """Stop every board at once. None comes back by itself."""
        self._reopen_at.clear()
        for board, port in self._pairs:
            board.emergency_stop(wall)
            self._pump(board, port, wall)

    def recover(self, wall: WallNs) -> None:
        """Make every board ready again that is shut down or lost; each says `Recovered`.

        A port that is gone is tried until it is there.
        """
        for board, port in self._pairs:
            if board.state in (State.LOST, State.REFUSED):
                self._reopen_at[board.name] = wall
            else:
                board.recover(wall)
            self._pump(board, port, wall)

    @property
    def acknowledged(self) -> int:
        """Messages that boards have taken since they were started."""
        return sum(board.core.link.acknowledged for board, _ in self._pairs)

    @property
    def quiet(self) -> bool:
        """Whether every board that is there has acknowledged what it was sent."""
        return all(board.core.link.idle for board, _ in self._pairs if not board.still)

    def close(self) -> None:
        """Let go of the ports. Outputs stay as they are; those with a watchdog fall to `off` when it runs out."""
        for _, port in self._pairs:
            port.close()

    def _read(self, board: Board, port: Port, wall: WallNs) -> None:
        try:
            data = port.receive(wall)
        except PortLost as error:
            self._gone(board, str(error), wall)
            return
        if data:
            board.receive(data, wall)
            if board.state is State.READY:
                self._new_clock(board, wall)
            self._pump(board, port, wall)

    def _pump(self, board: Board, port: Port, wall: WallNs) -> None:
        data = board.take()
        if not data:
            return
        try:
            port.send(data, wall)
        except PortLost as error:
            self._gone(board, str(error), wall)

    def _gone(self, board: Board, reason: str, wall: WallNs) -> None:
        if board.wants_reopening:
            self._reopen_at[board.name] = wall
        board.lose(reason, wall)

    def _reopen(self, board: Board, port: Port, wall: WallNs) -> None:
        if not port.reopen():
            self._reopen_at[board.name] = wall + REOPEN_EVERY
            return
        del self._reopen_at[board.name]
        if board.wants_reopening:
            board.start(wall)
        else:
            board.recover(wall)
        self._pump(board, port, wall)
