"""One driven axis within the cell that is driven: what it did, what it was told, whether it may move."""

from typing import NamedTuple, TypeAlias

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.controllers.device import Stage
from detent.realtime.boards.channels import Channel, alike
from detent.realtime.boards.guard import Guard
from detent.realtime.boards.plan import DrivenAxis
from detent.realtime.boards.states import Standing
from detent.realtime.boards.stepper import Stepper
from detent.realtime.pace import WallNs
from detent.ticks import NEVER, Ns

Motion: TypeAlias = MotionStarted | MotionCut | MotionEnded
PAST: Ns = -(1 << 62)  # before everything


class Staged(NamedTuple):
    """A power stage that was commanded, and the last pulse before that: it counts when that one has left the pins."""

    behind: Ns
    stage: Stage


class AxisLedger:
    """A driven axis. Its motions are a channel: they can be taken back."""

    def __init__(self, what: DrivenAxis, stepper: Stepper, guard: Guard, shaft: int) -> None:
        self.what, self.stepper, self.guard = what, stepper, guard
        self.motions: Channel[Motion] = Channel()
        self.stages: Channel[Staged] = Channel()
        self.standing, self.why, self.known = Standing.WAITING, "", True
        self.lost = False  # its board was without supply, and no switch has stopped it since: nobody knows its place
        self.stops = 0
        self.limited = 0.0  # amperes that were asked of its driver and are more than it gives; told
        self.awaits: tuple[str, WallNs] | None = None  # an input has stopped another axis, and this one too; since when
        self.held: tuple[str, bool, int] | None = None  # which input stopped it last, by which level, and where
        # no stop takes the cell back to before this time: the motor was elsewhere than the cell had it
        self.barred: Ns = PAST
        self.singles = 0  # so many times in a row a single pulse after the last time
        self._shaft = shaft  # at rest

    @property
    def name(self) -> str:
        """As people know it."""
        return self.what.stepper

    @property
    def motion(self) -> MotionStarted | None:
        """The motion under way."""
        return self.motion_after(self.motions.count)

    @property
    def rested(self) -> Ns | None:
        """Since when the cell has it at rest; None while it moves."""
        last = self.motions.before(self.motions.count)[-1:]
        if not last:
            return PAST
        return None if isinstance(last[0], MotionStarted) else last[0].at

    def motion_after(self, count: int) -> MotionStarted | None:
        """The motion in force behind the first `count` entries."""
        told = self.motions.before(count)
        return told[-1] if told and isinstance(told[-1], MotionStarted) else None

    def motions_from(self, at: Ns) -> list[Motion]:
        """The motion in force at `at`, if there is one, and everything behind it."""
        told = self.motions.before(self.motions.count)
        before = [motion for motion in told if motion.at <= at]
        force = before[-1:] if before and isinstance(before[-1], MotionStarted) else []
        return [*force, *told[len(before) :]]

    def take(self, entry: Motion) -> None:
        """The axis did this."""
        motion = self.motion
        if isinstance(entry, MotionStarted):
            self._shaft = entry.shaft
        elif motion is not None:
            self._shaft = motion.shaft + motion.direction * entry.last
        self.motions.append(entry)

    def staged(self, at: Ns, stage: Stage) -> None:
        """Its controller has commanded this at `at`."""
        self.stages.append(Staged(self._last_pulse(at), stage))

    def stage_at(self, now: Ns) -> Stage | None:
        """What counts at its pins at cell time `now`; None: nothing was commanded."""
        left = [staged.stage for staged in self.stages.since(0) if self.stepper.leaves(staged.behind, now) <= now]
        return left[-1] if left else None

    def staged_next(self, now: Ns) -> Ns:
        """The cell time at which something else counts, as it looks at `now`; NEVER: nothing that was sent waits."""
        times = [self.stepper.leaves(staged.behind, now) for staged in self.stages.since(0)]
        return min((at for at in times if at > now), default=NEVER)

    def _last_pulse(self, at: Ns) -> Ns:
        """When it gave its last pulse up to `at`; PAST where none is kept."""
        after: Motion | None = None
        for motion in reversed(self.motions.since(0)):
            if isinstance(motion, MotionStarted):
                if after is None:
                    last = _given(motion, at)
                else:
                    last = after.first - 1 if isinstance(after, MotionStarted) else after.last
                if last >= motion.first:
                    return motion.train.time_of(last)
            after = motion
        return PAST

    def take_back(self, count: int, shaft: int) -> list[Motion]:
        """Only the first `count` entries have happened, and the axis is at `shaft`; returned are the others."""
        self._shaft = shaft
        return self.motions.cut(count)

    def shaft_at(self, now: Ns) -> int:
        """Where the cell has the shaft."""
        motion = self.motion
        if motion is None:
            return self._shaft
        return motion.shaft + motion.direction * _given(motion, now)

    def place_at(self, at: Ns) -> int | None:
        """Where the cell had the shaft at `at`; None: longer ago than is kept."""
        told = self.motions.before(self.motions.count)
        place = next((n for n in range(len(told) - 1, -1, -1) if told[n].at <= at), None)
        if place is None:
            if told and isinstance(told[0], MotionStarted):  # it had been at rest there
                return told[0].shaft + told[0].direction * (told[0].first - 1)
            return None if told else self._shaft
        entry = told[place]
        if isinstance(entry, MotionStarted):
            return entry.shaft + entry.direction * _given(entry, at)
        before = told[place - 1] if place else None
        if isinstance(before, MotionStarted):
            return before.shaft + before.direction * entry.last
        after = told[place + 1] if place + 1 < len(told) else None
        if isinstance(after, MotionStarted):  # what was before that rest is not kept any more
            return after.shaft + after.direction * (after.first - 1)
        return self._shaft if after is None else None

    def end_told(self, now: Ns) -> None:
        """The motion that the stepper was told of last ends with what has left."""
        self.stepper.tell(MotionCut(now, 0, self.what.axis))

    def displace(self, by: int) -> None:
        """The shaft, at rest, is elsewhere: as if the last motion had ended there."""
        self._shaft += by
        told = self.motions.before(self.motions.count)[-2:]
        if len(told) == 2 and isinstance(told[0], MotionStarted):
            self.motions.amend(2, told[0]._replace(shaft=told[0].shaft + by))

    def instant_of(self, shaft: int, near: Ns) -> Ns:
        """The instant nearest to `near` at which the cell had the shaft at `shaft`; `near` itself if there is none.

        From the pulse that brought it there up to the last nanosecond before the next; at rest up to the next motion.
        """
        best, away = near, NEVER
        told = self.motions.before(self.motions.count)
        for place, motion in enumerate(told):
            if not isinstance(motion, MotionStarted):
                continue
            after = told[place + 1] if place + 1 < len(told) else None
            pulse = (shaft - motion.shaft) * motion.direction
            last = motion.train.steps
            if after is not None:
                last = after.first - 1 if isinstance(after, MotionStarted) else after.last
            if pulse < motion.first - 1 or (last is not None and pulse > last):
                continue
            if pulse >= motion.first:
                begin = motion.train.time_of(pulse)
            else:
                begin = motion.at if place else min(near, motion.at)  # it had been at rest there
            if pulse != last:
                end = motion.train.time_of(pulse + 1) - 1
            elif isinstance(after, MotionStarted):
                end = _before_first(after)
            else:
                following = told[place + 2] if place + 2 < len(told) else None
                end = NEVER if following is None else following.at
                if isinstance(following, MotionStarted):
                    end = _before_first(following)
            if begin > end:
                continue
            nearest = min(max(near, begin), end)
            if abs(nearest - near) < away:
                best, away = nearest, abs(nearest - near)
        return best

    def tell_difference(self, old: list[Motion], new: list[Motion], now: Ns) -> int:
        """Another axis was taken back, and in it this one did `new` instead of `old`. Pulses that left and are none.

        What both begin with was told already. Where nothing has left that is not so, the stepper is told of the rest.
        """
        same = alike(old, new)
        if same == len(old) == len(new):
            return 0
        force = self.motion_after(self.motions.count - len(new) + same)
        first = min(item.at for item in (*old[same : same + 1], *new[same : same + 1]))
        left, due = _pulses(force, old[same:], first, now), _pulses(force, new[same:], first, now)
        alright = alike(left, due)
        if alright < len(left):
            return len(left) - alright
        if same < len(old):
            last = old[-1]
            if isinstance(last, MotionStarted):
                self.stepper.tell(MotionCut(now, _given(last, now), self.what.axis))
            if force is not None:
                self.stepper.tell(force._replace(first=_given(force, first) + len(left) + 1))
        for motion in new[same:]:
            self.stepper.tell(motion)
        return 0


def _pulses(force: MotionStarted | None, told: list[Motion], after: Ns, until: Ns) -> list[tuple[Ns, int]]:
    """Time and direction of the pulses behind `after` and up to `until`, with `force` in force at `after`."""
    found: list[tuple[Ns, int]] = []
    current, low = force, 0 if force is None else _given(force, after)
    for motion in (*told, None):
        if current is not None:
            if isinstance(motion, MotionStarted):
                last = motion.first - 1
            else:
                last = _given(current, until) if motion is None else motion.last
            found += [(current.train.time_of(n), current.direction) for n in range(low + 1, last + 1)]
        current = motion if isinstance(motion, MotionStarted) else None
        low = 0 if current is None else current.first - 1
    return found


def _before_first(motion: MotionStarted) -> Ns:
    """The last time at which a motion has begun, or is about to, and has given none of its pulses."""
    steps = motion.train.steps
    if steps is not None and steps < motion.first:
        return motion.at
    return min(motion.at, motion.train.time_of(motion.first) - 1)


def _given(motion: MotionStarted, now: Ns) -> int:
    return max(motion.train.steps_by(now), motion.first - 1)
