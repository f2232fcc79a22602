"""Stops in the firmware: an input that takes a level stops a stepper at once, without the host.

Each stepper has one trigger, with an endstop for each input that may stop it. An endstop is level-sensitive: an input
that is at its level already when the stop comes into force stops at once, so that arming has no race. The trigger stays
alive while what is armed changes, so that no instant is unguarded, and reports regularly: a report that was lost on the
way is followed by another.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from detent.realtime.boards.core import MASK, Core
from detent.realtime.boards.dictionary import Message, Value
from detent.realtime.boards.events import Stopped
from detent.realtime.boards.setup import InputSetup
from detent.realtime.boards.stepper import Stepper
from detent.realtime.pace import WallNs
from detent.ticks import MS, Ns

BY_THE_HOST = 255  # a reason that no input has
REPORT: Ns = 25 * MS  # of a trigger that is alive


@dataclass
class _Watched:
    """An input that may stop the stepper: its endstop in the firmware."""

    setup: InputSetup
    oid: int
    reason: int


class Stop:
    """The stop of one stepper; found as `board.stops[stepper name]`. What it does comes as a `Stopped` event."""

    def __init__(
        self, core: Core, stepper: Stepper, oid: int, inputs: Mapping[str, tuple[InputSetup, int]],
        read: Callable[[str, bool, WallNs], None],
    ) -> None:  # fmt: skip
        """`inputs`: by name, with the oid of an endstop each. `read` is told the level of an input that was asked."""
        self.stepper, self.oid = stepper.name, oid
        self._core, self._axis, self._read = core, stepper, read
        self._inputs = {name: _Watched(*found, n) for n, (name, found) in enumerate(inputs.items(), 1)}
        self._armed: dict[str, bool] = {}
        self._levels: dict[str, bool] = {}  # for which each was armed last
        self._changes: list[tuple[dict[str, bool], Ns]] = []  # wanted, and not sent yet
        self.clear()

    def clear(self) -> None:
        """The firmware has forgotten it all."""
        self._armed.clear()
        self._changes.clear()
        self._alive = False  # the trigger can fire
        self._deaf = 0  # not 0: reports may still be of the trigger before
        self._blind: WallNs | None = None  # since when reports were not listened to, and none has come since
        self._ignored = False  # a report came meanwhile
        self._quieting = 0  # 1: what is armed is nothing, its last word is awaited; 2: one more report
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

    @property
    def firing(self) -> bool:
        """Whether it has fired, and its event is not made yet."""
        return self._firing is not None

    def heard(self) -> WallNs | None:
        """Whatever it did up to this wall time was told; None: it can do nothing, and all of it was."""
        if not self._alive:
            return None
        if self._firing is not None:
            return 0  # when that was is not known yet
        heard = self._core.link.heard
        return heard if self._blind is None else min(heard, self._blind)

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

    def now(self) -> None:
        """Stop the stepper at once, as an input would: where it has been stopped already, nothing happens to it.

        Its event follows; without an input, if none has stopped it before.
        """
        self._core.command("trsync_trigger", oid=self.oid, reason=BY_THE_HOST)

    def commit(self, wall: WallNs) -> None:
        """Send what has changed."""
        changes, self._changes = self._changes, []
        for inputs, at in changes:
            self._change(inputs, at, wall)

    def _change(self, inputs: dict[str, bool], at: Ns, wall: WallNs) -> None:
        core = self._core
        if self._firing is not None:
            return  # it has fired: whoever hears of it arms anew
        for name in self._armed.keys() - inputs.keys():
            self._off(self._inputs[name])
        added = {name: level for name, level in inputs.items() if self._armed.get(name) is not level}
        self._armed = dict(inputs)
        if not inputs:
            self._quieting = 1 if self._alive else 0
            if self._alive:
                self._last_word(wall)
            return
        self._quieting = 0
        if not self._alive:
            self._axis.set_clock(wall)
            report = core.unhurried(wall)
            core.comes(report)
            core.command("trsync_start", oid=self.oid, report_clock=report & MASK, report_ticks=core.ticks(REPORT),
                         expire_reason=0)  # fmt: skip
            for oid in self._axis.oids:
                core.command("stepper_stop_on_trigger", oid=oid, trsync_oid=self.oid)
            self._alive = True
            self._listen_anew(wall)
        for name, level in added.items():
            self._on(self._inputs[name], level, at, wall)

    def _on(self, watched: _Watched, level: bool, at: Ns, wall: WallNs) -> None:
        core, setup = self._core, watched.setup
        self._levels[setup.name] = level
        sample = core.ticks(setup.sample)
        # its verdict on the level is there before the first pulse
        verdict = sample * setup.samples
        wanted = self._axis.tick(at) - verdict
        before = self._axis.over_by(at)  # a pulse of the very instant at which this motion began is none of its own
        clock = max(wanted, core.soonest(wall), wanted if before is None else before + 1)
        core.comes(clock)
        core.command(
            "endstop_home", oid=watched.oid, clock=clock & MASK, sample_ticks=sample, sample_count=setup.samples,
            rest_ticks=sample, pin_value=int(level is not setup.pin.active_low), trsync_oid=self.oid,
            trigger_reason=watched.reason,
        )  # fmt: skip
        if clock > wanted:
            self._axis.not_before(clock + verdict)

    def _listen_anew(self, wall: WallNs) -> None:
        """A report of the trigger before may still be on its way: behind the answer to this they are of this one."""
        self._deaf += 1
        self._blind, self._ignored = wall, False
        number = self._deaf

        def came(_: Message, __: WallNs) -> None:
            if number == self._deaf:
                self._listen()

        oid = next(iter(self._inputs.values())).oid
        self._core.ask("endstop_query_state", "endstop_state", came, wall, oid=oid)

    def _listen(self) -> None:
        self._deaf = 0
        if not self._ignored:
            self._blind = None

    def _off(self, watched: _Watched) -> None:
        self._core.command(
            "endstop_home", oid=watched.oid, clock=0, sample_ticks=0, sample_count=0, rest_ticks=0, pin_value=0,
            trsync_oid=self.oid, trigger_reason=0,
        )  # fmt: skip

    def _last_word(self, wall: WallNs) -> None:
        """Behind the answer to this nothing can fire any more; what fired before is in the next report."""
        oid = next(iter(self._inputs.values())).oid

        def came(_: Message, __: WallNs) -> None:
            self._listen()  # this question has taken the place of that one
            if self._quieting == 1:
                self._quieting = 2

        self._core.ask("endstop_query_state", "endstop_state", came, wall, oid=oid)

    def _quiet(self) -> None:
        """No more reports."""
        self._core.command("trsync_start", oid=self.oid, report_clock=0, report_ticks=0, expire_reason=0)
        self._alive, self._quieting = False, 0

    # -- what the firmware says

    def reported(self, message: Message, wall: WallNs) -> None:
        """A trsync_state came."""
        if not self._alive:
            return
        if self._deaf:
            self._ignored = True  # it may have been of this trigger: the next one says it again
            return
        self._blind = None
        if message.number("can_trigger"):
            if self._quieting == 2:
                self._quiet()
            return
        if self._firing is not None:
            return
        self._fired(message.number("trigger_reason"), wall)

    def _fired(self, reason: int, wall: WallNs) -> None:
        core = self._core
        watched = next((one for one in self._inputs.values() if one.reason == reason), None)
        self._axis.halt()
        name = watched.setup.name if watched is not None else ""
        level = self._levels.get(name, True)
        levels: dict[str, bool] = {}
        self._firing = Stopped(core.setup.name, self.stepper, name, level, 0, 0, 0, level)
        self._changes.clear()
        for other in self._armed:
            self._off(self._inputs[other])
        self._armed.clear()
        waiting = {("stepper_position", oid) for oid in self._axis.oids}
        base = core.scale

        def came(message: Message, at: WallNs) -> None:
            waiting.discard((message.name, message.number("oid")))
            if message.name == "stepper_position":
                self._axis.position(message)
            else:
                asked = next(one for one in self._inputs.values() if one.oid == message.number("oid"))
                present = bool(message.number("pin_value")) is not asked.setup.pin.active_low
                levels[asked.setup.name] = present
                self._read(asked.setup.name, present, at)
                if asked is watched and self._firing is not None:
                    sample = core.ticks(asked.setup.sample)
                    edge = core.whole(message, "next_clock", at) - sample
                    stop = edge + (asked.setup.samples - 1) * sample
                    scale = base.later(self._axis.lag_at(stop))
                    self._firing = self._firing._replace(at=scale.time(stop), edge=scale.time(edge), present=present)
            if not waiting and self._firing is not None:
                core.events.append(self._firing._replace(shaft=self._axis.counted(), levels=levels))
                self._firing = None
                self._quiet()

        for oid in self._axis.oids:
            core.ask("stepper_get_position", "stepper_position", came, wall, oid=oid)
        for one in self._inputs.values():
            waiting.add(("endstop_state", one.oid))
            core.ask("endstop_query_state", "endstop_state", came, wall, oid=one.oid)
