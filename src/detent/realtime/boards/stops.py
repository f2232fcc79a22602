"""Stops in the firmware: an input that takes a level stops a stepper at once, without the host.

Each stepper has one trigger, with an endstop for each input that may stop it. An endstop is level-sensitive: an input
that is at its level already when the stop comes into force stops at once, so that arming has no race. The trigger stays
alive while what is armed changes, so that no instant is unguarded, and reports regularly: a report that was lost on the
way is followed by another.

Steps that come too late would make the firmware give up. So the trigger also fires by itself, at the last tick before
the next step is due, unless it has been put off by then, and the message that puts it off comes behind the steps.
Whatever is late then finds the stepper stopped, and is not carried out.
"""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from detent.realtime.boards.clock import nearest
from detent.realtime.boards.core import AHEAD, MASK, UNSURE, Core
from detent.realtime.boards.dictionary import Message, Value
from detent.realtime.boards.events import Stopped
from detent.realtime.boards.setup import InputSetup
from detent.realtime.boards.stepper import Stepper
from detent.realtime.pace import WallNs
from detent.ticks import MS, NEVER, Ns

BY_THE_HOST = 255  # reasons that no input has
DRY = 254
FAR: Ns = AHEAD  # at most, of the tick at which it fires by itself
REPORT: Ns = 25 * MS  # of a trigger that is alive


@dataclass
class _Watched:
    """An input that may stop the stepper: its endstop in the firmware, and the reason that it gives at either level."""

    setup: InputSetup
    oid: int
    reasons: tuple[int, int]


class _End(NamedTuple):
    """The tick at which a trigger fires by itself, with the messages that were said when it was told so.

    `at` is the cell time of that, as late as the stepper was then: what it made up to there was sent so.
    """

    tick: int
    said: int
    at: Ns


class Stop:
    """The stop of one stepper; found as `board.stops[stepper name]`. What it does comes as a `Stopped` event."""

    def __init__(
        self, core: Core, stepper: Stepper, oid: int, inputs: Mapping[str, tuple[InputSetup, int]],
        read: Callable[[str, bool, WallNs], None], level: Callable[[str], bool],
    ) -> None:  # fmt: skip
        """`inputs`: by name, with the oid of an endstop each. `read` is told the level of an input that was asked.

        `level` is what an input is at, as was heard last.
        """
        self.stepper, self.oid = stepper.name, oid
        self._core, self._axis, self._read, self._level = core, stepper, read, level
        self._inputs: dict[str, _Watched] = {}
        self._reasons: dict[int, tuple[_Watched, bool]] = {}  # which input has stopped it, by which level
        for n, (name, found) in enumerate(inputs.items()):
            self._inputs[name] = one = _Watched(*found, (2 * n + 1, 2 * n + 2))
            self._reasons |= {reason: (one, bool(at)) for at, reason in enumerate(one.reasons)}
        self._armed: dict[str, bool] = {}
        self._force: dict[str, int] = {}  # the tick at which what was armed last comes into force
        self._changes: list[tuple[dict[str, bool], Ns]] = []  # wanted, and not sent yet
        self.clear()

    def clear(self) -> None:
        """The firmware has forgotten it all."""
        self._armed.clear()
        self._changes.clear()
        self._alive = False  # the trigger can fire
        self._begun = 0  # messages that were said then: reports of a board that did not know them are of one before
        self._disarmed = 0  # the same, of the last input that was disarmed
        self._since: Ns | None = None  # cell time from which on an input may have stopped it
        self._until: int | None = None  # the tick at which it fires by itself
        self._before: deque[_End] = deque()  # what that was: it fires at one of these
        self._again = False  # that is to be put off before anything else happens
        self._quieted = 0  # messages that were said when it was told to be quiet: until then it may still have fired
        self._asked = False  # it was told to say where it stands, as steps come too late
        self._firing: Stopped | None = None

    def config(self) -> list[tuple[str, dict[str, Value | str]]]:
        """The commands that make it; pins by name."""
        made: list[tuple[str, dict[str, Value | str]]] = [("config_trsync", {"oid": self.oid})]
        for watched in self._inputs.values():
            pin = watched.setup.pin
            made.append(("config_endstop", {"oid": watched.oid, "pin": pin.name, "pull_up": pin.pull & 0xFF}))
        return made

    @property
    def armed(self) -> Mapping[str, bool]:
        """The inputs that stop the stepper at present, and the (logical) level at which they do; empty: disarmed."""
        return self._changes[-1][0] if self._changes else self._armed

    @property
    def pending(self) -> bool:
        """Whether something was armed or disarmed that is not sent yet."""
        return bool(self._changes)

    def watches(self, name: str, level: bool, wall: WallNs) -> bool:
        """Whether the stepper stops at once if an input takes a level at `wall`: it is armed, and in force by then."""
        return self._armed.get(name) is level and self._force[name] <= self._core.clock.tick_at(wall)

    @property
    def alive(self) -> bool:
        """Whether the firmware may stop the stepper."""
        return self._alive

    @property
    def firing(self) -> bool:
        """Whether it has fired, or is said to, and its event is not made yet."""
        return self._firing is not None or self._asked

    @property
    def firm(self) -> Ns:
        """Nothing up to this cell time is taken back by what an input does."""
        return min(self._since if self._since is not None else NEVER, *(at for _, at in self._changes), NEVER)

    def heard(self) -> WallNs | None:
        """Whatever it did up to this wall time was told; None: it can do nothing, and all of it was."""
        if not self._alive:
            return None
        return 0 if self.firing else self._core.link.heard  # when that was is not known yet

    def arm(self, inputs: Mapping[str, bool], at: Ns) -> None:
        """From cell time `at` on, `inputs` stop the stepper when they take their level; replaces what was armed.

        An input that is armed at that level already stays so without a gap. It comes into force when the pulses of
        `at` leave, so that it stops none of what was before, and none leaves sooner: where that is too near, the
        pulses are made later. It is sent with the next commit. KeyError for an input that may not stop this stepper;
        no inputs: disarm.
        """
        for name in inputs:
            if name not in self._inputs:
                raise KeyError(f"{name} cannot stop {self.stepper}: list it in its stops, on the same board")
        if dict(inputs) != self.armed:
            self._changes.append((dict(inputs), at))

    def disarm(self) -> None:
        """Nothing stops the stepper any more. A trigger that is on its way already still comes as an event."""
        self.arm({}, 0)

    def anew(self) -> None:
        """Its event is dealt with. What was armed since it fired begins too late, and must not pass for armed."""
        self._changes.clear()
        for name in self._armed:
            self._off(self._inputs[name])
        self._armed.clear()

    def now(self) -> None:
        """Stop the stepper at once, as an input would: where it has been stopped already, nothing happens to it.

        Its event follows; without an input, if none has stopped it before.
        """
        self._core.command("trsync_trigger", oid=self.oid, reason=BY_THE_HOST)

    def commit(self, wall: WallNs) -> None:
        """Send what has changed; what guards pulses that are due far ahead waits, as they do."""
        reach = self._core.reach(wall)
        while self._changes and (not self._changes[0][0] or self._axis.tick(self._changes[0][1]) <= reach):
            self._change(*self._changes.pop(0), wall)

    def _change(self, inputs: dict[str, bool], at: Ns, wall: WallNs) -> None:
        core = self._core
        if self._firing is not None:
            return  # it has fired: whoever hears of it arms anew
        for name in self._armed.keys() - inputs.keys():
            self._off(self._inputs[name])
        added = {name: level for name, level in inputs.items() if self._armed.get(name) is not level}
        self._armed = dict(inputs)
        if not inputs:
            self._disarmed = core.link.said
            return
        self._begin(wall)
        self._since = at if self._since is None else min(self._since, at)
        for name, level in added.items():
            self._on(self._inputs[name], level, at, wall)

    def _begin(self, wall: WallNs) -> None:
        """From here on the trigger can fire."""
        if self._alive:
            return
        core = self._core
        self._axis.set_clock(wall)
        report = core.after_lead(wall)
        core.comes(report)
        core.command("trsync_start", oid=self.oid, report_clock=report & MASK, report_ticks=core.ticks(REPORT),
                     expire_reason=DRY)  # fmt: skip
        for oid in self._axis.oids:
            core.command("stepper_stop_on_trigger", oid=oid, trsync_oid=self.oid)
        self._alive, self._until, self._begun = True, None, core.link.said
        if core.link.acknowledged >= self._quieted:
            self._before.clear()

    def _on(self, watched: _Watched, level: bool, at: Ns, wall: WallNs) -> None:
        core, setup = self._core, watched.setup
        sample = core.ticks(setup.sample)
        # its verdict on the level is there before the first pulse
        verdict = sample * setup.samples
        wanted = self._axis.tick(at) - verdict
        before = self._axis.over_by(at)  # a pulse of the very instant at which this motion began is none of its own
        clock = max(wanted, core.soonest(wall), wanted if before is None else before + 1)
        self._force[setup.name] = clock
        core.comes(clock)
        core.command(
            "endstop_home", oid=watched.oid, clock=clock & MASK, sample_ticks=sample, sample_count=setup.samples,
            rest_ticks=sample, pin_value=int(level is not setup.pin.active_low), trsync_oid=self.oid,
            trigger_reason=watched.reasons[level],
        )  # fmt: skip
        if clock > wanted:
            self._axis.not_before(clock + verdict)

    def _off(self, watched: _Watched) -> None:
        self._core.command(
            "endstop_home", oid=watched.oid, clock=0, sample_ticks=0, sample_count=0, rest_ticks=0, pin_value=0,
            trsync_oid=self.oid, trigger_reason=0,
        )  # fmt: skip

    # -- steps that come too late

    def dry(self, wall: WallNs) -> bool:
        """Whether it has fired by now, as the next steps have not come, or will before they can."""
        core = self._core
        late = core.clock.tick_at(wall) + core.ticks(core.setup.margin // 2)
        return self._alive and not self.firing and self._until is not None and self._until <= late

    def ask_dry(self, wall: WallNs) -> None:
        """It is `dry`: have it say where the stepper stands. It gets no steps before its event was dealt with."""
        self._asked = True
        self._axis.halt(dry=True)
        self._core.ask("trsync_trigger", "trsync_state", self._answered, wall, oid=self.oid, reason=DRY)

    def _answered(self, message: Message, wall: WallNs) -> None:
        if not self._asked:
            return
        if message.number("can_trigger") or self._core.known < self._begun:  # it was on its way
            self._core.ask("trsync_trigger", "trsync_state", self._answered, wall, oid=self.oid, reason=DRY)
        else:
            self.reported(message, wall)

    def before_steps(self, due: int | None, wall: WallNs) -> None:
        """No step of the stepper, or of another of its unit, is before tick `due`: it fires by then, if none comes."""
        core = self._core
        if due is None or self.firing or due <= core.soonest(wall) or self._axis.resting:
            return
        if self._alive and self._until is not None and self._until < due:
            return
        self._begin(wall)
        self._put_off(min(due - 1, core.clock.tick_at(wall) + core.ticks(FAR)), wall)

    def behind_steps(self, due: int | None, wall: WallNs) -> None:
        """Every step before tick `due` has been sent (None: of all that it was told): it need not fire before.

        That is said behind the steps: if they are late, so is this, and nothing is carried out of both.
        """
        core = self._core
        if not self._alive or self.firing or self._until is None:
            return
        far = core.clock.tick_at(wall) + core.ticks(FAR)
        if due is None or due > far:
            if self._until < far - core.ticks(FAR // 2):
                self._put_off(far, wall)
        elif due - 1 > self._until:
            self._put_off(due - 1, wall)
        self._again = due is None or due > far

    def _put_off(self, tick: int, wall: WallNs) -> None:
        core = self._core
        core.comes(tick)
        core.command("trsync_set_timeout", oid=self.oid, clock=tick & MASK)
        self._until = tick
        before, present = self._before, core.clock.tick_at(wall) + core.ticks(UNSURE)
        at = core.scale.later(core.ticks(self._axis.lag)).time(tick)
        before.append(_End(tick, core.link.said, at))
        while len(before) > 1 and before[1].said <= core.link.acknowledged and before[0].tick > present:
            before.popleft()  # the next one came in time

    def deadline(self) -> WallNs | None:
        """When `behind_steps` is wanted, though nothing was sent."""
        if not self._alive or self.firing or self._until is None or not self._again:
            return None
        return self._core.clock.wall_at(self._until) - FAR // 2

    def _quiet(self) -> None:
        """No more reports."""
        self._core.command("trsync_start", oid=self.oid, report_clock=0, report_ticks=0, expire_reason=0)
        self._alive, self._until, self._since = False, None, None
        self._quieted = 0

    # -- what the firmware says

    def reported(self, message: Message, wall: WallNs) -> None:
        """A trsync_state came."""
        known, fires = self._core.known, not message.number("can_trigger")
        if fires and known < self._quieted:  # it did, before it heard that it shall be quiet
            self._alive = True
        elif not self._alive or known < self._begun:
            return
        if not fires:
            while len(self._before) > 1 and self._before[1].said <= known:
                self._before.popleft()
            # nothing is under way that could be late, or could stop it
            if (
                not self.armed
                and not self.firing
                and self._axis.resting
                and known >= max(self._disarmed, self._axis.said)
            ):
                self._end(known, wall)
            return
        if self._firing is None:
            self._fired(message.number("trigger_reason"), wall)

    def _end(self, known: int, wall: WallNs) -> None:
        """It is not needed any more: quiet, as soon as it cannot fire on the way there.

        A host that was kept away hears this report and behind it that it fired since, as it was put off no further.
        """
        core = self._core
        far = core.clock.tick_at(wall) + core.ticks(FAR)
        if self._until is not None and self._until < far - core.ticks(FAR // 4 * 3):
            self._put_off(far, wall)
        elif self._until is None or known >= self._before[-1].said:
            self._quiet()
            self._quieted = core.link.said

    def _fired(self, reason: int, wall: WallNs) -> None:
        core = self._core
        # not for what it was armed last: the host may have armed the other level before it heard of this
        watched, level = self._reasons.get(reason, (None, True))
        self._asked = False
        self._axis.halt(dry=reason == DRY)
        name = watched.setup.name if watched is not None else ""
        self._firing = Stopped(core.setup.name, self.stepper, name, level, 0, 0, 0, level)
        if reason == DRY:
            ends = tuple(end.at for end in self._before)
            self._firing = self._firing._replace(dry=ends or (0,))
        self._changes.clear()
        for other in self._armed:
            self._off(self._inputs[other])
        self._armed.clear()
        waiting = {("stepper_position", oid) for oid in self._axis.oids}
        base = core.scale
        # it was before the time-out; a computer that was away since knows no better, and 32 bits may have gone round
        near = self._before[-1].tick if self._before else core.clock.tick_at(wall)

        def came(message: Message, at: WallNs) -> None:
            waiting.discard((message.name, message.number("oid")))
            if message.name == "stepper_position":
                self._axis.position(message)
            else:
                asked = next(one for one in self._inputs.values() if one.oid == message.number("oid"))
                present = bool(message.number("pin_value")) is not asked.setup.pin.active_low
                self._read(asked.setup.name, present, at)
                if asked is watched and self._firing is not None:
                    sample = core.ticks(asked.setup.sample)
                    edge = nearest(message.number("next_clock"), near) - sample
                    stop = edge + (asked.setup.samples - 1) * sample
                    scale = base.later(self._axis.lag_at(stop))
                    self._firing = self._firing._replace(at=scale.time(stop), edge=scale.time(edge))
            if not waiting and self._firing is not None:
                # an answer that was lost takes its time: what was reported since one was asked is newer than its answer
                levels = {one: self._level(one) for one in self._inputs}
                fired = self._firing._replace(present=levels.get(name, level), levels=levels)
                core.events.append(fired._replace(shaft=self._axis.counted()))
                self._firing = None
                self._quiet()

        for oid in self._axis.oids:
            core.ask("stepper_get_position", "stepper_position", came, wall, oid=oid)
        for one in self._inputs.values():
            waiting.add(("endstop_state", one.oid))
            core.ask("endstop_query_state", "endstop_state", came, wall, oid=one.oid)
