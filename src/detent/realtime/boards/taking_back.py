"""A stop in the firmware takes the cell back to where it happened, and the boards are told what is different since."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.actions import Action, SetPin, TimedAction
from detent.cell.recording import Batch
from detent.controllers.device import Powered
from detent.lines.line import Heard
from detent.pins import Level, PinSet
from detent.realtime.boards.axle import Axle, Motion
from detent.realtime.boards.channels import alike
from detent.realtime.boards.events import (
    Stopped,
)
from detent.realtime.boards.leaving import Leaving, Out
from detent.realtime.boards.past import Moment
from detent.realtime.boards.states import Standing, Weight
from detent.ticks import MS, Ns

AWAITED: Ns = 100 * MS  # reports of a trigger come every 25 ms
MOST_SINGLES = 8  # pulses in a row that an input stops one by one


class TakingBack(Leaving):
    """What is done when the firmware has stopped an axis."""

    def _stopped(self, event: Stopped) -> None:
        """The firmware has stopped an axis: the cell is taken back to there."""
        began = self._wall()
        axle = self._by_stepper[event.stepper]
        other, given = self._given_at.get(event.input, (axle, event.at))
        if other is not axle and event.at < given and axle.motion is None:
            self._stopped_too(
                axle, event
            )  # it is later than the other, and the input has stopped it in the cell already
            return
        axle.guard.fired()
        axle.stops += 1
        self.rewinds += 1
        unit, pin = self.plan.inputs[event.input]
        at = min(axle.instant_of(event.shaft, event.at), self.cell.now)
        if self.past.moments:
            at = max(at, self.past.moments[0].now)
        if not self.past.reaches(at) or axle.place_at(at) != event.shaft:
            self._fault(axle, f"{event.input} has stopped it at {event.shaft}, and nobody knows when that was")
            self._place(axle, event.shaft)
            return
        if self._gates(axle, event):
            what = f"{event.input} lets every single pulse through, and on real pins each takes some milliseconds"
            self._fault(axle, f"{what}: leave the input out, and wire the detector to the driver")
            self._place(axle, event.shaft)
            return
        # what the switches of this axis are at was so at the stop already: it stands, and reports take their time
        switches = {(unit, other) for other in self.cell.controller(unit).switches(axle.what.axis)}
        if (unit, pin) in switches:
            axle.lost, axle.known = False, True  # as far as a switch tells it
        others = {
            name: int(found)
            for name, found in event.levels.items()
            if name != event.input and self.plan.inputs[name] in switches
        }
        late = {self.plan.inputs[name] for name in (*others, event.input)}
        fresh = {(set_.unit, set_.pin) for when, set_, _ in self._reports if when > at}
        actions: list[Action] = []
        for name, found in others.items():
            place = self.plan.inputs[name]
            if place in fresh or self._given[name] != found:
                actions.append(SetPin(*place, found))
                self._raw[name] = self._given[name] = found
        self._given_at[event.input] = axle, at
        level = int(event.level)
        actions.append(SetPin(unit, pin, level))
        drop = {(when, set_) for when, set_, _ in self._reports if when > at and (set_.unit, set_.pin) in late}
        self._reports = deque((item for item in self._reports if item[:2] not in drop), maxlen=256)
        self._take_back(axle, at, actions, lambda action: (action.at, action.what) in drop, event)
        self._raw[event.input], self._given[event.input] = int(event.present), level
        if int(event.present) != level:
            self._give(event.input, int(event.present), self.clock())
        self._arm()
        self.commit()
        self.longest_rewind = max(self.longest_rewind, self._wall() - began)

    def _heard(self, levels: Mapping[str, bool]) -> None:
        """Inputs were asked for their levels, and no report tells them again: what the cell has not, it gets now."""
        for name, found in levels.items():
            self._raw[name] = int(found)
            if self._given[name] != int(found):
                self._give(name, int(found), self.clock())

    def _gates(self, axle: Axle, event: Stopped) -> bool:
        """Whether an input has stopped every single pulse of late."""
        last = axle.held
        alone = last is not None and last[:2] == (event.input, event.level) and abs(event.shaft - last[2]) <= 1
        axle.held = event.input, event.level, event.shaft
        axle.singles = axle.singles + 1 if alone else 0
        return axle.singles >= MOST_SINGLES

    def _take_back(
        self, stopped: Axle, at: Ns, actions: Sequence[Action], drop: Callable[[TimedAction], bool], event: Stopped
    ) -> None:
        """The cell lives on from `at`, where `actions` are done; tell the boards only what is different."""
        self.on_taken_back(at)
        motions: dict[str, list[Motion]] = {}
        levels: dict[str, list[tuple[Ns, bool]]] = {}
        counts: list[int] = []
        places: dict[str, int] = {}
        if not self.past.moments:
            self.past.keep()

        def arrived(moment: Moment) -> None:
            """The cell is at `at` again: what it did up to there was told before."""
            batches = self._batches()
            ahead = list(moment.counts)
            for place, axle in enumerate(self.axles):
                ahead[place] += sum(
                    isinstance(entry, (MotionStarted, MotionCut, MotionEnded)) and entry.axis == axle.what.axis
                    for unit, entries in batches
                    if axle in self._of_unit.get(unit, ())
                    for entry in entries
                )
            counts.extend(ahead[: len(self.axles)])
            for axle, count in zip(self.axles, counts, strict=True):
                before = axle.motions.before(count)
                here = axle.place_at(at)
                motions[axle.name] = axle.take_back(count, _rests(before, axle.shaft_at(at) if here is None else here))
            place = len(self.axles)
            for out in self._outs.values():
                count = moment.counts[place] + self._levels_in(batches, out)
                levels[out.name], places[out.name] = out.levels.cut(count), count
                place += 1
            for number in range(len(self.lines)):
                heard = self.cell.lines[number].take()
                counts.append(moment.counts[place] + len(heard))
                place += 1
            self._stores.cut()

        met: list[tuple[Ns, dict[str, Level]]] = []  # what would stop it, from when on

        def lived() -> None:
            self._take(self._batches(), tell=False)
            inputs = self._cuts(stopped)
            if not met or inputs != met[-1][1]:
                met.append((self.cell.now, inputs))

        self._stores.count = [m for m in self.past.moments if m.now <= at][-1].counts[-1]
        self.past.back(at, actions, drop, arrived, lived)
        lived()
        heard: list[list[Heard]] = [self.cell.lines[number].take() for number in range(len(self.lines))]
        for line, count, new in zip(self.lines, counts[len(self.axles) :], heard, strict=True):
            for wrong, right in line.rewind(count, new):
                self.escaped += 1
                instead = "" if right is None else f"; it would be {right.char.value:#04x}"
                what = f"a host heard {wrong.char.value:#04x} of {wrong.at / 1e9:.4f} s before a stop took it back"
                self._say(Weight.WARNING, what + instead)
        self._tell_axles(stopped, event, motions, counts)
        if stopped.standing is Standing.DRIVEN:  # before any pulse leaves; those that came and went meanwhile, too
            for when, inputs in met:
                stopped.guard.want(inputs, when, when)
        self._arm()
        self.commit()
        for out in self._outs.values():
            self._tell_out(out, levels[out.name], out.levels.since(places[out.name]), at, stopped)
        self._pending = True

    def _levels_in(self, batches: Sequence[Batch], out: Out) -> int:
        """How many items of the channel of an output these entries make."""
        count = 0
        for unit, entries in batches:
            if unit != out.unit:
                continue
            for entry in entries:
                if isinstance(entry, PinSet):
                    count += self._outs.get((unit, entry.pin)) is out
                elif isinstance(entry, Powered):
                    enables = any(axle.what.enable == out.name for axle in self._of_unit.get(unit, ()))
                    count += enables or not entry.on
        return count

    def _tell_axles(self, stopped: Axle, event: Stopped, old: dict[str, list[Motion]], counts: Sequence[int]) -> None:
        now = self.cell.now
        for axle, count in zip(self.axles, counts, strict=False):
            new = axle.motions.since(count)
            if axle.standing is not Standing.DRIVEN:
                continue
            if axle is not stopped:
                if new != old[axle.name] and axle.guard.armed.get(event.input) == int(event.level):
                    axle.awaits = event.input, self._wall()
                    axle.stepper.halt()
                    continue
                lost = axle.tell_difference(old[axle.name], new, now)
                if lost:
                    axle.end_told(now, old[axle.name])
                    self._contradicted(axle, stopped, lost)
                continue
            axle.stepper.rewind(event.shaft)
            force = axle.motion_after(count)
            if force is not None:
                axle.stepper.tell(force)
            for motion in new:
                axle.stepper.tell(motion)

    def _tell_out(
        self, out: Out, old: list[tuple[Ns, bool]], new: list[tuple[Ns, bool]], at: Ns, stopped: Axle
    ) -> None:
        mine = out.unit == self.cell.unit(stopped.what.unit)
        same = alike(old, new)
        if not mine and same == len(old):
            for when, level in new[same:]:
                self._set(out, level, when)
            return
        self.boards.outs[out.name].rewind(at)
        for when, level in new:
            self._set(out, level, when)

    def _stopped_too(self, axle: Axle, event: Stopped) -> None:
        """What stopped another axis stopped this one at the same instant: the cell has been there already.

        The two are looked at one after the other, and one may be later than the other: some steps may be between.
        """
        axle.awaits = None
        axle.guard.fired()
        axle.stops += 1
        if axle.motion is not None:
            self._fault(axle, f"{event.input} has stopped it, and it moves on in the cell")
        if event.shaft != axle.shaft_at(self.cell.now):
            self._place(axle, event.shaft)
            self.past.clear()  # nobody goes back to before that
            self.past.keep()
        axle.stepper.rewind(event.shaft)
        self._arm()
        self._pending = True

    def _not_stopped(self) -> None:
        """An axis that should have been stopped as another was, and was not, has made what it was sent."""
        for axle in self.axles:
            if axle.awaits is None or axle.standing is not Standing.DRIVEN:
                continue
            name, since = axle.awaits
            if self._wall() - since > self.plan.lead + axle.stepper.behind(self.cell.now) + AWAITED:
                axle.awaits = None
                self._fault(axle, f"{name} has not stopped it as it stopped another axis")
                self._place(axle, axle.stepper.shaft)

    def _contradicted(self, axle: Axle, stopped: Axle, lost: int) -> None:
        """Pulses left that the cell did not give after all: it is told where the motor is, and the axis stands."""
        if axle.what.unit == stopped.what.unit and axle.motion is None:  # it is ahead of the other, which slipped
            what = f"{lost} steps that had left when a late stop of {stopped.name} was told are counted all the same"
            self._say(Weight.WARNING, f"{axle.name}: {what}")
            self._place(axle, axle.stepper.shaft)
            self.past.clear()
            self.past.keep()
            return
        what = f"{lost} steps left the pins though a stop of {stopped.name} took them back"
        self._fault(axle, f"{what}: wires of the cell make it follow too closely; the counter says where it stands")
        self._place(axle, axle.stepper.shaft)


def _rests(before: Sequence[Motion], shaft: int) -> int:
    """Where an axis is at rest behind these entries; `shaft` if they say nothing of it."""
    if len(before) >= 2 and not isinstance(before[-1], MotionStarted) and isinstance(before[-2], MotionStarted):
        return before[-2].shaft + before[-2].direction * before[-1].last
    return shaft
