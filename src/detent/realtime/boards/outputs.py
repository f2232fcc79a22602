"""Digital outputs: levels at exact ticks, held on the host until shortly before they are due, with a watchdog."""

from collections import deque
from typing import NamedTuple

from detent.realtime.boards.core import MASK, UNSURE, Core
from detent.realtime.boards.dictionary import Value
from detent.realtime.boards.events import OutputLate
from detent.realtime.boards.lag import Lag
from detent.realtime.boards.setup import OutputSetup
from detent.realtime.pace import WallNs
from detent.ticks import MS, SECOND, Ns

HOLD: Ns = 8 * MS
"""A change is given to the board so long before it is due (or two margins): until then it can be taken back."""

PAST = -(1 << 62)  # a tick before everything
RETRY: WallNs = 1 * MS  # where a board has no room
TOLD: Ns = 1 * MS  # what is later is told
ONE_CHANGE = 16  # bytes of its message at most


class _Change(NamedTuple):
    at: Ns  # cell time
    tick: int
    level: bool
    fresh: bool  # where it is late, a late computer is to blame


class _Given(NamedTuple):
    change: _Change  # with the tick that it was given for
    before: bool  # the level there


class DigitalOut:
    """An output of a board; found as `board.outputs[name]`. Levels are logical.

    `level` is the last one that was given to the board. `corrections` counts the changes that had left when the cell
    was taken back to before them, and were corrected.
    """

    def __init__(self, core: Core, setup: OutputSetup, oid: int) -> None:
        self.name, self.setup, self.oid = setup.name, setup, oid
        self.level = setup.initial
        self.corrections = 0
        self._core = core
        self._pending: deque[_Change] = deque()
        self._given: deque[_Given] = deque(maxlen=64)  # of late; those that have yet to come are among them
        self._last_tick = PAST  # of what was given
        self._back: bool | None = None  # taken back: the level that it had there
        self._rewound = False
        self._fed_at: WallNs | None = None
        self._again_at: WallNs = 0  # not before: there was no room
        self.dead = True  # shut down, or not configured: nothing is sent
        self.of: Lag | None = None

    def shares(self, lag: Lag) -> None:
        """It is late together with the axes of `lag`."""
        self.of = lag
        lag.outputs.append(self)

    def config(self) -> tuple[str, dict[str, Value | str]]:
        """The command that makes it; pins by name."""
        setup = self.setup
        low = setup.pin.active_low
        return "config_digital_out", {
            "oid": self.oid, "pin": setup.pin.name, "value": int(setup.initial is not low),
            "default_value": int(setup.off is not low),
            "max_duration": 0 if setup.watchdog is None else self._core.ticks(setup.watchdog),
        }  # fmt: skip

    def set(self, level: bool, at: Ns, lag: Ns = 0, *, fresh: bool = True) -> None:
        """From cell time `at` on the output has `level`; it changes at `at` + lead + `lag` (of the unit's axis).

        Times do not fall, but for a `rewind`. Several changes at one instant come a tick apart each. What is due
        already is done at once; if it is `fresh`, and not what a stop has changed, `OutputLate` says so.
        """
        self._pending.append(_Change(at, self._core.scale.tick(at + lag), level, fresh))

    def rewind(self, at: Ns, level: bool) -> None:
        """The cell is taken back to `at`, where it has the output at `level`; what is set next is the truth.

        What had been given to the board for later, and is not set again alike, is corrected with the next commit.
        """
        while self._pending and self._pending[-1].at > at:
            self._pending.pop()
        while self._given and self._given[-1].change.at > at:
            self._given.pop()
        if not self._pending:  # else all that was given is for before `at`
            self._back, self._rewound = level, True

    def delayed(self, at: Ns, by: Ns, wall: WallNs) -> None:
        """What has yet to come, for cell time `at` or behind it, comes later by so much more.

        What was given to the board and cannot be called back is corrected, as it comes, until its time.
        """
        ticks, present = self._core.ticks(by), self._core.clock.tick_at(wall)
        self._pending = deque(
            change._replace(tick=change.tick + ticks) if change.at >= at else change for change in self._pending
        )
        while self._given and self._given[-1].change.at >= at and self._given[-1].change.tick > present:
            change, before = self._given.pop()
            self._pending.appendleft(change._replace(tick=change.tick + ticks))
            self._back, self._rewound = before, True

    def late(self, wall: WallNs, heard: WallNs | None) -> tuple[Ns, Ns] | None:
        """The cell time of its next change, and by how much it is late, if a late computer is to blame.

        None, too, where a stop that was not heard of yet (up to `heard`) may take it back.
        """
        core = self._core
        if self.dead or self._back is not None or not self._pending or not self._pending[0].fresh:
            return None
        change, present = self._pending[0], core.clock.tick_at(wall)
        if change.tick >= core.soonest(wall) or (heard is not None and core.clock.tick_at(heard) < change.tick):
            return None
        late = present + core.ticks(core.setup.lead // 2) - change.tick  # what follows is not in haste, too
        return change.at, -(-late * SECOND // core.frequency)

    def now(self, level: bool) -> None:
        """Take `level` as soon as may be, behind what was given to the board before; what was not is forgotten."""
        self._pending.clear()
        self._given.clear()
        self._back, self._rewound = level, False

    # -- what leaves

    def commit(self, wall: WallNs, heard: WallNs | None = None, firm: Ns = 0) -> bool:
        """Give the board what is due soon, and the watchdog its food. Whether a change waits for `heard`.

        That is the wall time up to which stops of the board have been heard of (None: there are none). What is late
        already waits for it, as one that took place meanwhile would take it back.

        What is set for cell time `firm` or before cannot be taken back: it is given at once, as far as the firmware
        takes it. So is a supply that is switched on, as the steps behind it may not come before it, however long the
        computer is elsewhere.
        """
        if not self.wants(wall):
            return False
        core = self._core
        soonest = core.soonest(wall)
        if self._back is not None:
            self._correct(self._back, soonest, wall)
        if self._back is not None:
            return False  # what is set next comes behind it
        reach = self._reach(wall)
        horizon = soonest + core.ticks(max(HOLD - core.setup.margin, core.setup.margin))
        known = None if heard is None else core.clock.tick_at(heard)
        waits = False
        while (
            self._pending
            and not (self.of is not None and self.of.waits)
            and (self._switches_on() or not (self.of is not None and self.of.has_yet_to_step(self._pending[0].at)))
            and (
                self._pending[0].tick <= horizon
                or ((self._pending[0].at <= firm or self._switches_on()) and self._pending[0].tick <= reach)
            )
        ):
            if known is not None and known < self._pending[0].tick < soonest and not self._switches_on():
                waits = True
                break
            change, before = self._pending.popleft(), self.level
            if not self._give(change.tick, change.level, soonest, wall):
                self._pending.appendleft(change)
                return False
            came = max(self._last_tick, core.clock.tick_at(wall))
            self._given.append(_Given(change._replace(tick=came), before))
            self._tell(change, came)
        if self._hungry(wall):
            self._feed(wall)
        return waits

    def _reach(self, wall: WallNs) -> int:
        """The last tick for which a change may be given: the firmware takes none beyond the end of its watchdog."""
        core, setup = self._core, self.setup
        reach = core.reach(wall)
        if setup.watchdog is None or self.level is setup.off:
            return reach
        fed = max(self._last_tick, core.clock.tick_at(self._fed_at or 0))
        return min(reach, fed + core.ticks(setup.watchdog - core.setup.margin))

    def _switches_on(self) -> bool:
        """Whether the next change gives a power stage its supply."""
        return self.setup.supply and self._pending[0].level

    def _tell(self, change: _Change, came: int) -> None:
        """It was given for tick `came`: say so, if it was late."""
        core = self._core
        by = came - change.tick
        if change.fresh and by > core.ticks(TOLD):
            core.events.append(OutputLate(core.setup.name, self.name, change.at, by * SECOND // core.frequency))

    def wants(self, wall: WallNs) -> bool:
        """Whether there is anything to give to the board, soon or now."""
        return not self.dead and (bool(self._pending) or self._back is not None or self._hungry(wall))

    def _correct(self, level: bool, soonest: int, wall: WallNs) -> None:
        """Behind a rewind: what is set for ticks that are given away already cannot come then."""
        while self._pending and self._pending[0].tick <= self._last_tick:
            level = self._pending.popleft().level
        if level is not self.level:
            if not self._give(PAST, level, soonest, wall):
                self._back = level
                return
            self.corrections += self._rewound
        self._back = None

    def _give(self, tick: int, level: bool, soonest: int, wall: WallNs) -> bool:
        """Whether it was given. What is late already has no time: that could be later still, on the wire."""
        core = self._core
        if tick < soonest and self._last_tick < core.clock.tick_at(wall):
            return self._at_once(level, wall)
        if core.queue.room(core.clock.tick_at(wall) - core.ticks(UNSURE)) <= 0 or core.link.spare < ONE_CHANGE:
            self._again_at = wall + RETRY
            return False
        tick = max(tick, soonest, self._last_tick + 1)
        core.comes(tick)
        core.command("queue_digital_out", oid=self.oid, clock=tick & MASK,
                     on_ticks=int(level is not self.setup.pin.active_low))  # fmt: skip
        core.queue.take(self.oid, tick)
        self._last_tick, self.level, self._fed_at = tick, level, wall
        return True

    def _feed(self, wall: WallNs) -> None:
        """Say the level that it has, which must not wait for long."""
        if self._last_tick < self._core.clock.tick_at(wall):
            self._at_once(self.level, wall)
        else:
            self._again_at = self._core.clock.wall_at(self._last_tick)

    def _at_once(self, level: bool, wall: WallNs) -> bool:
        """Say a level that has no time, and so cannot be late. Whether it was said.

        What was queued is over by now, as far as can be told; but if it is not, the firmware shuts down. So the board
        has to have told of a later tick, and is asked where it has not.
        """
        core = self._core
        told = self._last_tick < core.clock.reached
        if not told or core.link.spare < ONE_CHANGE:
            self._again_at = wall + RETRY
            if not told:
                core.look_at_clock(wall)
            return False
        core.command("update_digital_out", oid=self.oid, value=int(level is not self.setup.pin.active_low))
        self.level, self._fed_at = level, wall
        return True

    def _hungry(self, wall: WallNs) -> bool:
        at = self.deadline()
        return at is not None and wall >= at

    def deadline(self) -> WallNs | None:
        """When the watchdog wants to be fed."""
        if self.dead:
            return None
        if self.setup.watchdog is None or self.level is self.setup.off:
            return None
        return max((self._fed_at or 0) + self.setup.watchdog // 4, self._again_at)

    def pending_at(self) -> WallNs | None:
        """When the next change has to be given to the board."""
        if self.dead or not (self._pending or self._back is not None):
            return None
        core = self._core
        if self._back is not None:
            return 0
        return core.clock.wall_at(self._pending[0].tick) - max(HOLD, 2 * core.setup.margin)

    # -- what the firmware does

    def began(self, wall: WallNs, level: bool | None = None) -> None:
        """The board is configured, or ready again, with the output at `level` (None: as it is set up)."""
        self.level = self.setup.initial if level is None else level
        self._pending.clear()
        self._given.clear()
        self._back = None
        self._last_tick = PAST
        self._fed_at = wall - (self.setup.watchdog or 0)
        self.dead = False

    def shut_down(self) -> None:
        """It has fallen to `off`."""
        self.dead = True
        self._pending.clear()
        self.level = self.setup.off
