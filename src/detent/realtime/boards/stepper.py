"""One axis: what a controller's axis does goes in, runs of steps for the firmware come out.

Only pulses that are certain are sent: those with a time at or before the present of the cell. What the cell changes
its mind about later has then not left, or is given at the same times by the new train (`Axis.replan`).
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.outputs.steps import Run, Runs
from detent.pulses import Train
from detent.realtime.boards.core import MASK, UNSURE, Core
from detent.realtime.boards.dictionary import Message, Value
from detent.realtime.boards.events import CountDiffers, Slipped
from detent.realtime.boards.fresh import Undo, kept, together
from detent.realtime.boards.setup import StepperSetup
from detent.realtime.pace import WallNs
from detent.ticks import MS, SECOND, Ns

LONGEST = 64  # steps of a run: looking further ahead costs more than it saves where a commit cuts runs anyway
NOWHERE = -(1 << 62)  # before everything: the first run gets a base of its own
SETTLED: Ns = 20 * MS  # a rest longer than the lag by this takes it back to 0
ONE_RUN = 40  # bytes of messages at most, with a direction and a clock
SPARE = 4  # entries of the move queue that are left to outputs


@dataclass
class _Span:
    """Pulses of one train, `next` and following, up to `last` (None: not known yet)."""

    train: Train
    next: int
    last: int | None
    direction: int
    shaft: int  # at pulse 0


class _Channel:
    """A stepper of the firmware: one step pin. `sign` is what a step with dir = 1 adds to the shaft."""

    def __init__(self, oid: int, sign: int) -> None:
        self.oid, self.sign = oid, sign
        self.position = 0  # as the firmware last said
        self.forget()

    def forget(self) -> None:
        """It has stopped, or is new, or was left by somebody: it wants a clock and a direction."""
        self.last: int | None = None  # the tick of the last step sent
        self.up: bool | None = None


class Stepper:
    """An axis on a board; made by `Board` from its `StepperSetup`, found as `board.steppers[name]`.

    `slips` and `slipped`: how often a late batch moved the rest of the train, and by how much in all.
    """

    def __init__(self, core: Core, setup: StepperSetup, oids: Sequence[int]) -> None:
        """With a clock for each direction there are two `oids`: + and -."""
        self.name, self.setup = setup.name, setup
        self.slips = 0
        self.slipped: Ns = 0
        self.told_through: Ns | None = None  # cell time of the last pulse sent
        self._core = core
        sign = -1 if setup.dir.active_low and setup.minus is None else 1
        self._channels = [_Channel(oids[0], sign)]
        if setup.minus is not None:
            self._channels.append(_Channel(oids[1], -1))
        self._spans: deque[_Span] = deque()
        self._runs: Runs | None = None
        self._offset = 0  # shaft less what the firmware counts
        self._told = 0  # the shaft behind every pulse told of, with those of an open train as sent
        self._sent = 0
        self._lag = 0  # ticks
        self._trail: tuple[Ns, int] = 0, 0  # the last pulse that came with an earlier lag, and that lag
        self._sent_at: WallNs = 0
        self._not_before = NOWHERE  # no pulse up to this tick: a stop is not in force yet
        self._halted = True  # nothing is sent before `adopt` or `rewind`
        self._regaining = False
        self._proved = True  # the count was compared since the last pulse

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

    @property
    def lag(self) -> Ns:
        """So much later than the lead its pulses come at present.

        It grows by slips (a late batch) and by pulses that a cell which was taken back gives too late, and is 0 again
        behind a rest that is long enough.
        """
        return self._lag * SECOND // self._core.frequency

    def behind(self, now: Ns) -> Ns:
        """So much later than the lead come the pulses that have yet to leave at cell time `now`: `lag`, or one before.

        What a rest has caught up counts from the motion behind it on: pulses of the motion before are still under way.
        """
        through, lag = self._trail
        earlier = lag * SECOND // self._core.frequency
        return max(self.lag, earlier) if now <= through + self._core.setup.lead + earlier else self.lag

    def lag_at(self, tick: int) -> int:
        """The lag, in ticks, of a pulse that was on its way at `tick`."""
        through, lag = self._trail
        return lag if lag and tick <= self._core.scale.tick(through) + lag else self._lag

    def tick(self, at: Ns) -> int:
        """The tick at which leaves what the axis does at cell time `at`, with the lag that it has now."""
        return self._core.scale.later(self._lag).tick(at)

    @property
    def shaft(self) -> int:
        """Where every pulse that was sent, and the rest of those that are certain to come, put the shaft."""
        return self._told

    @property
    def resting(self) -> bool:
        """Whether no pulse is to come that was told of. The last one sent may still be a lead away."""
        return not self._spans

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
        self._spans.append(_Span(entry.train, following, None, entry.direction, entry.shaft))

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
        if not self._lag or not train.segments:
            return
        rest = train.time_of(1) - (self.told_through or 0)
        if self.told_through is None or rest > self.lag + SETTLED:
            through, earlier = self._trail
            lead = self._core.setup.lead
            under_way = now <= through + lead + earlier * SECOND // self._core.frequency
            self._trail = self.told_through or 0, max(self._lag, earlier) if under_way else self._lag
            self._lag = 0

    def over(self, wall: WallNs) -> bool:
        """Whether it rests, and the last pulse sent has come."""
        last = max((channel.last for channel in self._channels if channel.last is not None), default=NOWHERE)
        return not self._spans and self._core.clock.tick_at(wall) > last

    def adopt(self, shaft: int) -> None:
        """The shaft of the axis is `shaft` now, where the firmware stands: at the start, and behind a restart."""
        self._offset = shaft - self._counted()
        self.rewind(shaft)
        self._regaining = False
        self._lag, self._trail = 0, (0, 0)

    def rewind(self, shaft: int) -> None:
        """Forget every entry told so far: the firmware has stopped, and counts `shaft`.

        What the cell does from the instant on to which it was taken back is told next, beginning with the
        MotionStarted in force there, if any; pulses up to that instant are not given again. Pulses too near are made
        later (`lag` grows).
        """
        self._spans.clear()
        self._runs = None
        self._told = self._sent = shaft
        self._halted = False
        self._regaining = True
        self._proved = False

    def next_pulse(self) -> Ns | None:
        """The cell time from which on the next pulse is certain; None if none is to come."""
        if self._halted or not self._spans:
            return None
        span = self._spans[0]
        if span.last is not None and span.next > span.last:
            return None
        return span.train.time_of(span.next)

    # -- what leaves

    def settle(self, now: Ns, wall: WallNs) -> None:
        """Let the lag grow as what `commit` is about to send needs it, so that stops can be sent for it before."""
        due = self.next_pulse()
        if due is not None and due <= now:
            span = self._spans[0]
            self._guard(span, self._runs or self._make(span), wall)

    def commit(self, now: Ns, wall: WallNs) -> None:
        """Send every pulse with a time up to `now`, as far as the move queue has room."""
        guarded = False
        while self._spans:
            span = self._spans[0]
            upto = span.train.steps_by(now)
            if span.last is not None:
                upto = min(upto, span.last)
            if span.next <= upto:
                runs = self._runs
                if runs is None:
                    runs = self._runs = self._make(span)
                if not guarded:
                    runs, guarded = self._guard(span, runs, wall), True
                self._send(span, runs, upto, wall)
                if span.next <= upto:
                    return  # the queue is full
            if span.last is None or span.next <= span.last:
                return
            self._spans.popleft()
            self._runs = None

    def _channel(self, direction: int) -> _Channel:
        return self._channels[-1] if direction < 0 else self._channels[0]

    def _make(self, span: _Span) -> Runs:
        last = self._channel(span.direction).last
        core = self._core
        return Runs(span.train, core.scale.later(self._lag), core.setup.error, NOWHERE if last is None else last,
                    span.next, longest=LONGEST)  # fmt: skip

    def _guard(self, span: _Span, runs: Runs, wall: WallNs) -> Runs:
        """See that the next pulse is far enough away; else everything from it on moves later."""
        core = self._core
        due = runs.due()
        assert due is not None
        error = core.setup.error
        if error != "exact":
            due -= core.ticks(error)
        soonest = core.soonest(wall)
        late = max(soonest, self._not_before + 1) - due
        if late <= 0:
            self._regaining = False
            return runs
        self._lag += late
        if soonest > due and not self._regaining:
            by = late * SECOND // core.frequency
            self.slips += 1
            self.slipped += by
            core.events.append(Slipped(core.setup.name, self.name, span.train.time_of(span.next), by))
        self._regaining = False
        self._runs = self._make(span)
        return self._runs

    def kept(self) -> Undo:
        """As it is now, again: nothing of what is sent from now on was sent."""
        spans = deque(replace(span) for span in self._spans)
        undo = together((kept(self), *(kept(channel) for channel in self._channels)))

        def back() -> None:
            undo()
            self._spans, self._runs = spans, None

        return back

    def rescale(self) -> None:
        """The scale of cell time to ticks has changed: what is sent from now on follows it."""
        self._runs = None

    def _send(self, span: _Span, runs: Runs, upto: int, wall: WallNs) -> None:
        core, channel = self._core, self._channel(span.direction)
        up = True if len(self._channels) > 1 else span.direction == channel.sign
        now = core.clock.tick_at(wall)
        room = core.queue.room(now - core.ticks(UNSURE)) - SPARE
        due = runs.due()
        assert due is not None
        if due - now > core.ticks(core.setup.lead) // 2 and (
            wall - self._sent_at < core.setup.batch or 2 * room < core.queue.size
        ):
            return  # what waits a little makes longer runs, and there is time
        self._sent_at = wall
        # what would have to wait for an acknowledgement is made when it has come: it might be late by then
        while span.next <= upto and room > 0 and core.link.spare >= ONE_RUN:
            run = runs.one(upto)
            self._put(channel, run, up)
            room -= 2  # a run behind a long rest takes two entries
            span.next += run.steps
            self._sent += span.direction * run.steps
            self._proved = False
        if span.last is None:
            self._told = self._sent
        self.told_through = span.train.time_of(span.next - 1) if span.next > 1 else self.told_through

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

    def not_before(self, tick: int) -> None:
        """No pulse at or before `tick`: a stop comes into force then."""
        self._not_before = max(self._not_before, tick)

    # -- what the firmware does

    def halt(self) -> None:
        """The firmware has stopped it, or is gone: nothing more is sent until `rewind`."""
        self._halted = True
        self._spans.clear()
        self._runs = None
        for channel in self._channels:
            channel.forget()
            self._core.queue.forget(channel.oid)

    def position(self, message: Message) -> None:
        """A stepper_position came."""
        for channel in self._channels:
            if channel.oid == message.number("oid"):
                channel.position = message.number("pos")

    def counted(self) -> int:
        """The shaft as the firmware last counted it."""
        return self._counted() + self._offset

    def _counted(self) -> int:
        return sum(channel.sign * channel.position for channel in self._channels)

    def proof_due(self) -> WallNs | None:
        """When the count can be compared: at rest, behind the last pulse."""
        if self._proved or self._halted or self._spans:
            return None
        last = max((channel.last for channel in self._channels if channel.last is not None), default=None)
        if last is None:
            return None
        core = self._core
        return core.clock.wall_at(last + core.ticks(self.setup.pulse * 2 + UNSURE))

    def prove(self, wall: WallNs) -> None:
        """Ask the firmware for its count, and compare it unless something has been sent meanwhile."""
        self._proved = True
        waiting = set(self.oids)

        def came(message: Message, _: WallNs) -> None:
            self.position(message)
            waiting.discard(message.number("oid"))
            if waiting or not self._proved or self._halted or self._spans:
                return
            if self.counted() != self._told:
                core = self._core
                core.events.append(CountDiffers(core.setup.name, self.name, self._told, self.counted()))

        for oid in self.oids:
            self._core.ask("stepper_get_position", "stepper_position", came, wall, oid=oid)
