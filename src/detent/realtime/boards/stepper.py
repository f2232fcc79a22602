"""One axis: what a controller's axis does goes in, runs of steps for the firmware come out.

Only pulses that are certain are sent: those with a time at or before the present of the cell. What the cell changes
its mind about later has then not left, or is given at the same times by the new train (`Axis.replan`).
"""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.outputs.steps import Run, Runs
from detent.pulses import Train
from detent.realtime.boards.core import MASK, UNSURE, Core
from detent.realtime.boards.count import Count
from detent.realtime.boards.dictionary import Message, Value
from detent.realtime.boards.events import CountDiffers, CountEnds, Slipped
from detent.realtime.boards.lag import Lag, Late
from detent.realtime.boards.setup import StepperSetup
from detent.realtime.boards.undo import Undo
from detent.realtime.pace import WallNs
from detent.ticks import MS, NEVER, SECOND, Ns

LONGEST = 64  # steps of a run: looking further ahead costs more than it saves where a commit cuts runs anyway
NOWHERE = -(1 << 62)  # before everything: the first run gets a base of its own
LOOK_AGAIN: WallNs = 100 * MS  # slower than any step whose time is a matter of doubt
CLOCK_AGAIN: WallNs = 1 * MS  # a board that was asked for its clock has answered by then, or soon
SPARE = 4  # entries of the move queue that are left to outputs


@dataclass
class _Span:
    """Pulses of one train, `next` and following, up to `last` (None: not known yet)."""

    train: Train
    next: int
    last: int | None
    direction: int
    shaft: int  # at pulse 0
    anew: bool  # a motion of its own: what was before is over
    not_before: int  # no pulse of it up to this tick: a stop is not in force yet
    _at: tuple[int, Ns] = (0, 0)

    @property
    def at(self) -> Ns:
        """When its next pulse is."""
        if self._at[0] != self.next:
            self._at = self.next, self.train.time_of(self.next)
        return self._at[1]


class _Channel:
    """A stepper of the firmware: one step pin. `sign` is what a step with dir = 1 adds to the shaft."""

    def __init__(self, oid: int, sign: int) -> None:
        self.oid, self.sign = oid, sign
        self.answer = 0  # as the firmware last said
        self.count = Count()
        self.forget()

    def forget(self) -> None:
        """It has stopped, or is new, or was left by somebody: it wants a clock and a direction."""
        self.last: int | None = None  # the tick of the last step sent
        self.up: bool | None = None


class Stepper:
    """An axis on a board; made by `Board` from its `StepperSetup`, found as `board.steppers[name]`.

    What is late moves the rest of all trains of its unit: see `Lag`.
    """

    def __init__(self, core: Core, setup: StepperSetup, oids: Sequence[int]) -> None:
        """With a clock for each direction there are two `oids`: + and -."""
        self.name, self.setup = setup.name, setup
        self.of = Lag()
        self.shares(self.of)
        self._own: Ns = 0  # lag beyond that of its unit
        self._trail: tuple[Ns, Ns] = 0, 0  # the last pulse that came with an earlier lag, and that lag
        self._sooner: tuple[Ns, Ns] = 0, 0  # the last pulse that was sent before the lag grew last, and that lag
        self._grown = NOWHERE  # the tick of the first pulse that comes later since
        self._through: tuple[Train, int] | None = None  # the last pulse sent
        self._core = core
        sign = -1 if setup.dir.active_low and setup.minus is None else 1
        self._channels = [_Channel(oids[0], sign)]
        if setup.minus is not None:
            self._channels.append(_Channel(oids[1], -1))
        self._spans: deque[_Span] = deque()
        self._runs: Runs | None = None
        self._runs_lag: Ns = 0  # with which they were made
        self._offset = 0  # shaft less what the firmware counts
        self._told = 0  # the shaft behind every pulse told of, with those of an open train as sent
        self._sent = 0
        self._sent_at: WallNs = 0
        self._not_before = NOWHERE  # no pulse up to this tick: a stop is not in force yet
        self._halted = True  # nothing is sent before `adopt` or `rewind`
        self._stopped = False  # the firmware has stopped it, and has not just been left with what it had
        self._regaining = False
        self._proved = True  # the count was compared since the last pulse
        self._again_at: WallNs = 0  # not sooner: the board was asked for its clock
        self._doubted: tuple[int, WallNs] | None = None  # by how much the count differed, and when that is believed
        self.said = 0  # messages up to its newest step
        self.dried = False  # it waits for `rewind`, as its steps were late

    # -- configuration

    @property
    def oids(self) -> Sequence[int]:
        """Of its steppers in the firmware."""
        return [channel.oid for channel in self._channels]

    def config(self) -> list[tuple[str, dict[str, Value | str]]]:
        """The commands that make it; pins by name."""
        setup = self.setup
        pins = [setup.step] if setup.minus is None else [setup.step, setup.minus]
        return [
            ("config_stepper", {
                "oid": channel.oid, "step_pin": pin.name, "dir_pin": setup.dir.name,
                "invert_step": int(pin.active_low), "step_pulse_ticks": self._core.ticks(setup.pulse),
            })
            for channel, pin in zip(self._channels, pins, strict=True)
        ]  # fmt: skip

    # -- what the cell tells

    def shares(self, lag: Lag) -> None:
        """It is late together with the other axes of `lag`."""
        self.of.axes = [axis for axis in self.of.axes if axis is not self]
        self.of = lag
        lag.axes.append(self)

    @property
    def board(self) -> str:
        """The name of its board."""
        return self._core.setup.name

    @property
    def lag(self) -> Ns:
        """So much later than the lead its pulses come at present: that of its unit, and what it needs beyond."""
        return self.of.now + self._own

    @property
    def slips(self) -> int:
        """How often its unit was late."""
        return self.of.slips

    @property
    def slipped(self) -> Ns:
        """By how much in all."""
        return self.of.slipped

    def behind(self, now: Ns) -> Ns:
        """So much later than the lead come the pulses that have yet to leave at cell time `now`: `lag`, or one before.

        What a rest has caught up counts from the motion behind it on: pulses of the motion before are still under way.
        """
        through, earlier = self._trail
        return max(self.lag, earlier) if now <= through + self._core.setup.lead + earlier else self.lag

    def leaves(self, at: Ns, now: Ns) -> Ns:
        """The cell time at which its pulses up to `at` have left the pins, as it looks at cell time `now`.

        What was sent before the lag grew leaves sooner than what comes later since. NEVER: they have to be sent first.
        """
        due = self.next_pulse()
        if due is not None and due <= at:
            return NEVER
        through, lag = self._sooner
        return at + self._core.setup.lead + (min(lag, self.behind(now)) if at <= through else self.behind(now))

    def lag_at(self, tick: int) -> int:
        """The lag, in ticks, of a pulse that was on its way at `tick`."""
        core, (through, earlier), (sent, sooner) = self._core, self._trail, self._sooner
        if earlier and tick <= core.scale.tick(through) + core.ticks(earlier):
            return core.ticks(earlier)
        if sooner < self.lag and tick < max(self._grown, core.scale.tick(sent) + core.ticks(sooner) + 1):
            return core.ticks(sooner)
        return core.ticks(self.lag)

    @property
    def told_through(self) -> Ns | None:
        """Cell time of the last pulse sent."""
        return None if self._through is None else self._through[0].time_of(self._through[1])

    def delayed(self, at: Ns, by: Ns, *, slip: bool, own: bool) -> None:
        """From cell time `at` on it comes later by so much more; `own`: it alone, and not its unit."""
        if own:
            self._own += by
        if slip:
            self._core.events.append(Slipped(self.board, self.name, at, by))

    def grew(self, before: Ns) -> None:
        """Its lag was `before` for what it was sent."""
        due = self.next_pulse()
        if self.told_through is not None:
            through = self.told_through if due is None else min(self.told_through, due - 1)  # and not what was not made
            if through != self._sooner[0]:
                self._sooner = through, before
        # until then a motion under way is where its last pulse left it; one that has yet to begin is later, all of it
        self._grown = self.tick(due) if due is not None and self.under_way else NOWHERE

    def caught_up(self, now: Ns) -> None:
        """Its next pulse comes a lead behind the cell again, whatever the last one did, which may be under way."""
        self._trail, self._own = (self.told_through or 0, self.behind(now)), 0

    def over_by(self, at: Ns) -> int | None:
        """The tick by which every pulse of the motions has come that were over at cell time `at`, where one began then.

        None: the motion in force goes on from before, or nobody knows of one before it.
        """
        if not self._spans or not self._spans[-1].anew or self._spans[-1].train is (self._through or (None,))[0]:
            return None
        ticks = [channel.last for channel in self._channels if channel.last is not None]
        error = 0 if self._core.setup.error == "exact" else self._core.ticks(self._core.setup.error)
        ends = [span.train.time_of(span.last) for span in list(self._spans)[:-1] if span.last is not None]
        ticks += [self.tick(end) + error for end in ends if end <= at]
        return max(ticks, default=None)

    def tick(self, at: Ns) -> int:
        """The tick at which leaves what the axis does at cell time `at`, with the lag that it has now."""
        return self._core.scale.later(self._core.ticks(self.lag)).tick(at)

    @property
    def shaft(self) -> int:
        """Where every pulse that was sent, and the rest of those that are certain to come, put the shaft."""
        return self._told

    @property
    def resting(self) -> bool:
        """Whether no pulse is to come that was told of. The last one sent may still be a lead away."""
        return not self._spans

    @property
    def under_way(self) -> bool:
        """Whether a motion goes on of which pulses were sent."""
        return bool(self._spans) and not (self._spans[0].anew and self._spans[0].next == 1)

    def tell(self, entry: MotionStarted | MotionCut | MotionEnded) -> None:
        """What the axis did, in the order in which it was drained. Nothing is sent before `Boards.commit`.

        While it is stopped (between `Stopped`, `ShutDown` or `Lost` and `rewind`) everything told is dropped.
        """
        if self._halted:
            return
        if not isinstance(entry, MotionStarted):
            self._close(entry.last)
            return
        self._close(entry.first - 1)
        # behind a rewind a motion under way is told again as it was told first: what was given is not given again
        following = max(entry.first, (self._told - entry.shaft) * entry.direction + 1)
        if following == 1 and not self._spans:
            self._rested(entry.train, entry.at)
        self._spans.append(
            _Span(entry.train, following, None, entry.direction, entry.shaft, entry.first == 1, self._not_before)
        )

    def _close(self, last: int) -> None:
        """The train under way ends with pulse `last`."""
        if self._spans and self._spans[-1].last is None:
            span = self._spans[-1]
            span.last = max(last, span.next - 1)
            self._told = span.shaft + span.direction * span.last
            if span.next > span.last:  # all of it has left
                self._spans.pop()
                if not self._spans:
                    self._runs = None

    def _rested(self, train: Train, now: Ns) -> None:
        """A motion begins: the lag of the one before is over if there was time enough between."""
        if not self.lag or not train.segments:
            return
        first = train.time_of(1)
        self.of.rested(first, now)
        if self._own and self.of.settled(first, self):
            self.caught_up(now)

    def over(self, wall: WallNs) -> bool:
        """Whether it rests, and the last pulse sent has come."""
        return not self._spans and self._all_come(wall)

    def stands(self, wall: WallNs) -> int | None:
        """Where, if every pulse sent has come, and none is waited for that was too late; None: it moves, or may have.

        What it was told of, and is not sent yet, may still come.
        """
        return self._sent if self._all_come(wall) and not self._halted else None

    def _all_come(self, wall: WallNs) -> bool:
        last = max((channel.last for channel in self._channels if channel.last is not None), default=NOWHERE)
        return self._core.clock.tick_at(wall) > last

    def adopt(self, shaft: int) -> None:
        """The shaft of the axis is `shaft` now, where the firmware stands: at the start, and behind a restart."""
        for channel in self._channels:
            channel.count = Count(channel.answer)
        self._offset = shaft - self._counted()
        self.rewind(shaft)
        self._regaining = False
        self.of.forget()
        self._own, self._trail = 0, (0, 0)

    def rewind(self, shaft: int, *, slipped: bool = False) -> None:
        """Forget every entry told so far: the firmware has stopped, and counts `shaft`.

        What the cell does from the instant on to which it was taken back is told next, beginning with the
        MotionStarted in force there, if any; pulses up to that instant are not given again. Pulses too near are made
        later (`lag` grows). `slipped`: it has stopped as these were late already.
        """
        self._spans.clear()
        self._runs = None
        self._told = self._sent = shaft
        self._halted = self._stopped = False
        self._regaining, self.dried = not slipped, False
        self._sooner, self._grown = (0, 0), NOWHERE  # some of what was sent then may not have been made
        self._proved, self._doubted = False, None

    def next_pulse(self) -> Ns | None:
        """The cell time from which on the next pulse is certain; None if none is to come."""
        if self._halted or not self._spans:
            return None
        span = self._spans[0]
        if span.last is not None and span.next > span.last:
            return None
        return span.at

    def due(self) -> int | None:
        """The tick before which its next pulse cannot come; None: none is to come, as far as it was told."""
        if self.next_pulse() is None:
            return None
        tick, error = self._ready(self._spans[0]).due(), self._core.setup.error
        return None if tick is None else tick - (0 if error == "exact" else self._core.ticks(error))

    # -- what leaves

    def late(self, now: Ns, wall: WallNs) -> Late | None:
        """By how much the next pulse that the cell has given up to `now` is too near, and whether that is a slip."""
        due = self.next_pulse()
        if due is None or due > now:
            return None
        core, span = self._core, self._spans[0]
        tick = self._ready(span).due()
        assert tick is not None
        error = core.setup.error
        if error != "exact":
            tick -= core.ticks(error)
        soonest = core.soonest(wall)
        slip = soonest > tick and not self._regaining
        if slip:  # there is a hole in the train anyway: what follows it is not in haste, too
            soonest = max(soonest, core.clock.tick_at(wall) + core.ticks(core.setup.lead // 2))
        late = max(soonest, span.not_before + 1) - tick
        self._regaining = False
        return None if late <= 0 else Late(-(-late * SECOND // core.frequency), slip)

    def sending(self, now: Ns, wall: WallNs) -> Iterator[int]:
        """Send every pulse with a time up to `now`, as far as the move queue has room; `settle` has been called.

        Before each run it gives the tick at which that is due, and sends it when it is asked for the next one: so
        whoever has several axes sends what is due first. It may be left off at any time. What is due far ahead, as the
        unit is that late, waits.
        """
        core = self._core
        present, reach = core.clock.tick_at(wall), core.reach(wall)
        while self._spans:
            span = self._spans[0]
            upto = span.train.steps_by(now)
            if span.last is not None:
                upto = min(upto, span.last)
            if span.next <= upto and self._may_wait(span, present, wall):
                return
            while span.next <= upto:
                due = self._ready(span).due()
                assert due is not None
                if due > reach:
                    return
                yield due
                if core.queue.room(present - core.ticks(UNSURE)) <= SPARE:
                    return
                self._send(span, upto, wall)
            if span.last is None or span.next <= span.last:
                return
            self._spans.popleft()
            self._runs = None
            if self._spans and self._spans[0].not_before > present:
                return  # its pulses may have to be made later first

    def _channel(self, direction: int) -> _Channel:
        return self._channels[-1] if direction < 0 else self._channels[0]

    def _ready(self, span: _Span) -> Runs:
        """Its pulses as runs, with the lag that its unit has now."""
        if self._runs is None or self._runs_lag != self.lag:
            core, last = self._core, self._channel(span.direction).last
            self._runs_lag = self.lag
            self._runs = Runs(span.train, core.scale.later(core.ticks(self.lag)), core.setup.error,
                              NOWHERE if last is None else last, span.next, longest=LONGEST)  # fmt: skip
        return self._runs

    def kept(self) -> Undo:
        """As it is now, again: nothing of what is sent from now on was sent."""
        spans = deque(replace(span) for span in self._spans)
        channels = [(channel.last, channel.up, channel.count) for channel in self._channels]
        own = (self._own, self._told, self._sent, self._sent_at, self._not_before, self._regaining, self._proved,
               self._through, self._halted, self.said, self.dried)  # fmt: skip
        of = self.of
        shared = of.now, of.slips, of.slipped

        def undo() -> None:
            self._spans, self._runs = spans, None
            for channel, told in zip(self._channels, channels, strict=True):
                channel.last, channel.up, channel.count = told
            (self._own, self._told, self._sent, self._sent_at, self._not_before, self._regaining, self._proved,
             self._through, self._halted, self.said, self.dried) = own  # fmt: skip
            of.now, of.slips, of.slipped = shared

        return undo

    def rescale(self) -> None:
        """The scale of cell time to ticks has changed: what is sent from now on follows it."""
        self._runs = None

    def _may_wait(self, span: _Span, present: int, wall: WallNs) -> bool:
        """Whether there is time to gather more: that makes longer runs."""
        core, due = self._core, self._ready(span).due()
        assert due is not None
        if due - present <= core.ticks(core.setup.lead) // 2:
            return False
        room = core.queue.room(present - core.ticks(UNSURE)) - SPARE
        return wall - self._sent_at < core.setup.batch or 2 * room < core.queue.size

    def _send(self, span: _Span, upto: int, wall: WallNs) -> None:
        channel = self._channel(span.direction)
        run = self._ready(span).one(upto)
        self._put(channel, run, True if len(self._channels) > 1 else span.direction == channel.sign)
        span.next += run.steps
        self._sent += span.direction * run.steps
        self._sent_at, self._proved = wall, False
        if span.last is None:
            self._told = self._sent
        self._through = span.train, span.next - 1

    def _put(self, channel: _Channel, run: Run, up: bool) -> None:
        """Send a run.

        A step clock is set only where the firmware has none: behind a stop it takes no step until it gets one, and a
        host that has not heard of the stop yet must not give it. Behind a long rest the first interval is therefore
        counted from the last step all the same, in the 32 bits of the firmware's clock.
        """
        core = self._core
        if channel.up is not up:
            core.command("set_next_step_dir", oid=channel.oid, dir=int(up))
            channel.up = up
        rest: Run | None = run
        core.comes(run.tick(1))
        if channel.last is None:
            core.command("reset_step_clock", oid=channel.oid, clock=run.base & MASK)
        elif run.base != channel.last:
            interval = run.tick(1) - channel.last & MASK
            core.command("queue_step", oid=channel.oid, interval=interval, count=1, add=0)
            core.queue.take(channel.oid, run.tick(1))
            rest = run.split(1)[1] if run.steps > 1 else None
        if rest is not None:
            core.command("queue_step", oid=channel.oid, interval=rest.interval, count=rest.steps, add=rest.add)
            core.queue.take(channel.oid, rest.tick(1))
        channel.last = run.last
        channel.count = channel.count.sent(run.steps if up else -run.steps)
        self.said = core.link.said

    def set_clock(self, wall: WallNs) -> None:
        """Give the firmware a step clock where it has none: before a stop can fire, as behind that is too late."""
        for channel in self._channels:
            if channel.last is None:
                channel.last = self._core.clock.tick_at(wall)
                self._core.command("reset_step_clock", oid=channel.oid, clock=channel.last & MASK)
        self._runs = None

    def not_before(self, tick: int) -> None:
        """No pulse of the newest motion at or before `tick`: a stop comes into force then."""
        self._not_before = max(self._not_before, tick)
        if self._spans:
            self._spans[-1].not_before = self._not_before

    def wait_behind(self, at: Ns, span: Ns) -> None:
        """No pulse of the newest motion until `span` after what the axis did at cell time `at` has left."""
        self.not_before(self.tick(at) + self._core.ticks(span))

    # -- what the firmware does

    def halt(self, *, dry: bool = False, stopped: bool = True) -> None:
        """Nothing more is sent until `rewind`. `dry`: its steps were late.

        The firmware has `stopped` it; or it is gone, and makes what it has.
        """
        self._halted, self.dried = True, dry
        self._stopped = self._stopped or stopped
        self.said = 0
        self._spans.clear()
        self._runs = None
        for channel in self._channels:
            channel.forget()
            self._core.queue.forget(channel.oid)

    def position(self, message: Message) -> None:
        """A stepper_position came."""
        for channel in self._channels:
            if channel.oid != message.number("oid"):
                continue
            channel.answer = message.number("pos")
            if self._halted:
                if channel.count.doubtful(channel.answer):
                    self._core.events.append(CountEnds(self.board, self.name))
                channel.count = channel.count.found(channel.answer, stopped=self._stopped)

    def counted(self) -> int:
        """The shaft as the firmware last counted it."""
        return self._counted() + self._offset

    def _counted(self) -> int:
        return sum(channel.sign * channel.count.whole(channel.answer) for channel in self._channels)

    def proof_due(self) -> WallNs | None:
        """When the count can be compared: at rest, behind the last pulse."""
        if self._proved or self._halted or self._spans:
            return None
        last = max((channel.last for channel in self._channels if channel.last is not None), default=None)
        if last is None:
            return None
        core = self._core
        at = max(core.clock.wall_at(last + core.ticks(self.setup.pulse * 2 + UNSURE)), self._again_at)
        return at if self._doubted is None else max(at, self._doubted[1])

    @property
    def proving(self) -> bool:
        """Whether its count has yet to be compared, or is being asked for."""
        return self.proof_due() is not None or any(self._core.asking("stepper_position", oid) for oid in self.oids)

    def prove(self, wall: WallNs) -> None:
        """Ask the firmware for its count, and compare it unless something has been sent meanwhile.

        Before that the board has to have told of a tick behind the last step: an estimate of its clock may be off. One
        that differs is believed when it differs by the same a while later, behind another motion perhaps: a clock that
        runs behind what is known of it steps later.
        """
        core = self._core
        last = max(channel.last for channel in self._channels if channel.last is not None)
        if core.clock.reached <= last + core.ticks(self.setup.pulse * 2):
            self._again_at = wall + CLOCK_AGAIN
            core.look_at_clock(wall)
            return
        self._proved = True
        waiting = set(self.oids)

        def came(message: Message, at: WallNs) -> None:
            self.position(message)
            waiting.discard(message.number("oid"))
            if waiting or not self._proved or self._halted or self._spans:
                return
            by = self.counted() - self._told
            if not by:
                self._doubted = None
            elif self._doubted is None or self._doubted[0] != by:
                self._doubted, self._proved = (by, at + LOOK_AGAIN), False
            else:
                core.events.append(CountDiffers(core.setup.name, self.name, self._told, self.counted()))

        for oid in self.oids:
            core.ask("stepper_get_position", "stepper_position", came, wall, oid=oid)
