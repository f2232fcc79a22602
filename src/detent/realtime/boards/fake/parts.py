"""What can be configured on the fake board: steppers, endstops and their triggers, outputs, buttons."""

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from detent.realtime.boards.fake import chips
from detent.realtime.boards.fake.part import Home, Part, Shutdown

MASK = 0xFFFFFFFF
POLLS_OF_RETRANSMIT = 0x80
COUNT_END = 1 << 30


class _Move(NamedTuple):
    interval: int
    steps: int
    add: int
    turn: bool


class Stepper(Part):
    """Executes queued runs. The active edge of a step is one event, the end of its pulse is reckoned."""

    def __init__(self, board: Home, step_pin: int, dir_pin: int, invert_step: int, step_pulse_ticks: int) -> None:
        super().__init__(board)
        self.step, self.dir = board.pin(step_pin), board.pin(dir_pin)
        self.pulse, self.both_edges = step_pulse_ticks, invert_step > 127 or invert_step < 0
        self.position = 0  # taken steps
        self.queue: deque[_Move] = deque()
        self.count = 0  # steps left of the run that is loaded
        self.interval = self.add = 0
        self.next_step = 0
        self.earliest = 0  # of the next edge: when the pulse before and the time after it are over
        self.going_up = self.next_up = False
        self.counting_up = False  # the direction of the run that is loaded
        self.need_reset = False
        self.stop_signal: Trsync | None = None
        self._timer: list[bool] = [False]
        board.machine.drive(self.dir, False, board.now)

    def queue_step(self, interval: int, count: int, add: int) -> None:
        """A run of steps."""
        board = self.board
        board.take_move()
        if not count:
            raise Shutdown("Invalid count parameter")
        active = self.count > 0 or self._timer[0]
        if not active and self.need_reset:
            board.free_move()
            return
        turn = self.going_up is not self.next_up
        self.going_up = self.next_up
        self.queue.append(_Move(interval & MASK, count, add, turn))
        if not active:
            self._load(False)

    def _load(self, was_active: bool) -> None:
        """The next run of the queue, if there is one: now, or at the end of the last pulse."""
        if not self.queue:
            return
        board = self.board
        move = self.queue.popleft()
        board.free_move()
        self.count, self.interval, self.add = move.steps, move.interval + move.add, move.add
        # 32 bits: behind a long rest the interval goes round
        self.next_step = board.whole(self.next_step + move.interval)
        at = self.next_step
        if was_active and at < self.earliest:
            if at - self.earliest < -board.frequency // 1000:
                raise Shutdown("Stepper too far in past")
            at = self.earliest
        if move.turn:
            self.counting_up = not self.counting_up
            board.machine.drive(self.dir, not board.machine.outputs[self.dir], board.now)
            if was_active:
                at = max(at, board.now + self.pulse)
        self._timer = board.at(at, self._edge, check=not was_active)

    def _edge(self, tick: int) -> None:
        board = self.board
        self.position += 1 if self.counting_up else -1
        self.count -= 1
        over = tick + self.pulse
        self.earliest = over + self.pulse
        if self.count:
            self.next_step += self.interval
            self.interval += self.add
            self._timer = board.at(max(self.next_step, self.earliest), self._edge, check=False)
        else:
            self._timer = board.at(over, self._pulse_over, check=False)
        board.machine.pulse(self.step, self.dir, tick)

    def _pulse_over(self, tick: int) -> None:
        self.earliest = tick + self.pulse
        self._load(True)

    def set_next_step_dir(self, dir: int) -> None:
        """The direction of the runs that are queued next."""
        self.next_up = bool(dir)

    def reset_step_clock(self, clock: int) -> None:
        """The tick from which the next run counts."""
        if self.count or self._timer[0]:
            raise Shutdown("Can't reset time when stepper active")
        self.next_step = self.board.whole(clock)
        self.earliest = 0
        self.need_reset = False

    def stepper_get_position(self) -> None:
        """Steps taken, + while DIR is high."""
        self.board.respond("stepper_position", oid=self.oid, pos=self._answer())

    def _answer(self) -> int:
        """In 31 bits: beyond 2^30 steps it runs back."""
        place = (self.position + COUNT_END) & MASK
        return (place if place <= 2 * COUNT_END else MASK + 1 - place) - COUNT_END

    def stepper_stop_on_trigger(self, trsync_oid: int) -> None:
        """Stop when that trigger fires."""
        if self.stop_signal is not None:
            raise Shutdown("Can't add signal that is already active")
        self.stop_signal = self.board.part(trsync_oid, Trsync)
        self.stop_signal.steppers.append(self)

    def stop(self) -> None:
        """At once: nothing is queued, DIR is low, and a new clock is wanted."""
        self._timer[0] = False
        for _ in self.queue:
            self.board.free_move()
        self.queue.clear()
        self.position = self._answer()  # is what it counts from
        self.count, self.earliest = 0, 0
        self.going_up = self.next_up = self.counting_up = False
        self.need_reset = True
        self.board.machine.drive(self.dir, False, self.board.now)

    def shut_down(self) -> None:
        """The same, with the move queue made anew by the board."""
        self.queue.clear()
        self.stop()


class Endstop(Part):
    """An input that is sampled while it is armed, and fires a trigger. Only samples that matter are events."""

    def __init__(self, board: Home, pin: int, pull_up: int) -> None:
        super().__init__(board)
        self.pin = board.pin(pin)
        board.machine.pulled_up[self.pin] = pull_up == 1
        self.armed = False
        self.next_wake = 0
        self._timer: list[bool] = [False]

    def endstop_home(
        self, clock: int, sample_ticks: int, sample_count: int, rest_ticks: int, pin_value: int, trsync_oid: int,
        trigger_reason: int,
    ) -> None:  # fmt: skip
        """Arm it from `clock` on, or with no samples disarm it."""
        self._timer[0] = False
        self.armed = bool(sample_count)
        if not sample_count:
            return
        self.clock, self.sample, self.rest = self.board.whole(clock), sample_ticks, rest_ticks
        self.count, self.left, self.wanted = sample_count, sample_count, bool(pin_value)
        self.trsync: Trsync = self.board.part(trsync_oid, Trsync)
        self.reason = trigger_reason
        if self.clock < self.board.now:
            raise Shutdown("Timer too close")
        self._timer = self.board.at(self.clock, self._first, check=False)

    def pin_changed(self, pin: str, level: bool, tick: int) -> None:
        """The level that it waits for: the next sample on its grid sees it."""
        if self.armed and pin == self.pin and level is self.wanted and not self._timer[0]:
            steps = -(-(max(tick, self.clock) - self.clock) // self.rest)
            self._timer = self.board.at(self.clock + steps * self.rest, self._first, check=False)

    def _matches(self) -> bool:
        return self.board.machine.level(self.pin) is self.wanted

    def _first(self, tick: int) -> None:
        self.clock = tick
        if not self._matches():
            return
        self.next_wake = tick + self.rest
        self._again(tick)

    def _again(self, tick: int) -> None:
        if not self._matches():
            self.left, self.clock = self.count, self.next_wake
            return
        self.left -= 1
        if self.left:
            self._timer = self.board.at(tick + self.sample, self._again, check=False)
            return
        self.trsync.trigger(self.reason)

    def endstop_query_state(self) -> None:
        """Whether it is armed, when it would have been sampled after the first match, and the level now."""
        level = self.board.machine.level(self.pin)
        self.board.respond("endstop_state", oid=self.oid, homing=int(self.armed), next_clock=self.next_wake & MASK,
                           pin_value=int(level))  # fmt: skip

    def shut_down(self) -> None:
        """Its timer is gone."""
        self._timer = [False]
        self.armed = False


class Trsync(Part):
    """A trigger: fires once, stops its steppers, reports."""

    def __init__(self, board: Home) -> None:
        super().__init__(board)
        self.steppers: list[Stepper] = []
        self.can_trigger = False
        self.reason = self.expire_reason = 0
        self._report: list[bool] = [False]
        self._expire: list[bool] = [False]

    def trsync_start(self, report_clock: int, report_ticks: int, expire_reason: int) -> None:
        """Be ready to fire; report every so often."""
        self._clear()
        self.can_trigger, self.reason, self.expire_reason = True, 0, expire_reason
        self.report_ticks = report_ticks
        if report_ticks:
            self._report = self.board.at(self.board.whole(report_clock), self._reported)

    def trsync_set_timeout(self, clock: int) -> None:
        """Fire then at the latest."""
        if self.can_trigger:
            self._expire[0] = False
            self._expire = self.board.at(self.board.whole(clock), lambda _: self.trigger(self.expire_reason))

    def trsync_trigger(self, reason: int) -> None:
        """Fire now, and be done."""
        self._fire(reason)
        self._report[0] = self._expire[0] = False
        self.can_trigger = False
        self.board.respond("trsync_state", oid=self.oid, can_trigger=0, trigger_reason=self.reason, clock=0)

    def trigger(self, reason: int) -> None:
        """Fire, if it has not, and tell."""
        if self._fire(reason):
            self._tell()

    def _fire(self, reason: int) -> bool:
        if not self.can_trigger:
            return False
        self.can_trigger, self.reason = False, reason
        steppers, self.steppers = self.steppers, []
        for stepper in steppers:
            stepper.stop_signal = None
            stepper.stop()
        return True

    def _reported(self, tick: int) -> None:
        self._report = self.board.at(tick + self.report_ticks, self._reported, check=False)
        self._tell()

    def _tell(self) -> None:
        board = self.board
        board.respond("trsync_state", oid=self.oid, can_trigger=int(self.can_trigger), trigger_reason=self.reason,
                      clock=board.now & MASK)  # fmt: skip

    def _clear(self) -> None:
        self._report[0] = self._expire[0] = False
        for stepper in self.steppers:
            stepper.stop_signal = None
        self.steppers = []
        self.can_trigger = False

    def shut_down(self) -> None:
        """Nothing can fire."""
        self._clear()


class DigitalOut(Part):
    """An output with a queue of its own, and a watchdog."""

    def __init__(self, board: Home, pin: int, value: int, default_value: int, max_duration: int) -> None:
        super().__init__(board)
        self.pin, self.default, self.longest = board.pin(pin), bool(default_value), max_duration
        self.level = bool(value)
        self.queue: deque[tuple[int, bool]] = deque()
        self.end: int | None = None  # by which something has to be loaded
        self._timer: list[bool] = [False]
        board.machine.drive(self.pin, self.level, board.now)

    def queue_digital_out(self, clock: int, on_ticks: int) -> None:
        """A level at a tick."""
        board = self.board
        board.take_move()
        at = board.whole(clock)
        self.queue.append((at, bool(on_ticks)))
        if len(self.queue) > 1:
            return
        if self.end is not None and self.end < at:
            raise Shutdown("Scheduled digital out event will exceed max_duration")
        self.end = at
        self._timer[0] = False
        self._timer = board.at(at, self._load)

    def _load(self, tick: int) -> None:
        board = self.board
        if not self.queue:
            raise Shutdown("Missed scheduling of next digital out event")
        at, level = self.queue.popleft()
        board.free_move()
        self._drive(level)
        self.end = at + self.longest if self.longest and level is not self.default else None
        if self.queue:
            following = self.queue[0][0]
            if self.end is not None and self.end < following:
                raise Shutdown("Scheduled digital out event will exceed max_duration")
            self.end = following
        if self.end is not None:
            if self.end < tick - board.frequency // 10:
                raise Shutdown("Rescheduled timer in the past")
            self._timer = board.at(self.end, self._load, check=False)

    def update_digital_out(self, value: int) -> None:
        """A level at once."""
        self._timer[0] = False
        if self.queue:
            raise Shutdown("update_digital_out not valid with active queue")
        self._drive(bool(value))
        self.end = None
        if self.longest and bool(value) is not self.default:
            self.end = self.board.now + self.longest
            self._timer = self.board.at(self.end, self._load)

    def _drive(self, level: bool) -> None:
        self.level = level
        self.board.machine.drive(self.pin, level, self.board.now)

    def shut_down(self) -> None:
        """Its default."""
        self.queue.clear()
        self.end = None
        self._timer = [False]
        self._drive(self.default)


class Buttons(Part):
    """Up to eight inputs, polled; a level counts when two polls agree. Only polls that matter are events."""

    def __init__(self, board: Home, button_count: int) -> None:
        super().__init__(board)
        if button_count > 8:
            raise Shutdown("Max of 8 buttons")
        self.pins: list[str | None] = [None] * button_count
        self.rest = 0
        self.reports: list[int] = []
        self._timer: list[bool] = [False]

    def buttons_add(self, pos: int, pin: int, pull_up: int) -> None:
        """The pin of one of them."""
        if pos >= len(self.pins):
            raise Shutdown("Set button past maximum button count")
        name = self.pins[pos] = self.board.pin(pin)
        self.board.machine.pulled_up[name] = pull_up == 1

    def buttons_query(self, clock: int, rest_ticks: int, retransmit_count: int, invert: int) -> None:
        """Poll from `clock` on; `invert` are the levels that are known."""
        self._timer[0] = False
        self.clock, self.rest = self.board.whole(clock), rest_ticks
        self.pressed = self.last = invert
        self.acknowledged, self.reports = 0, []
        self.retransmit, self.countdown = retransmit_count, -1
        if rest_ticks:
            self._timer = self.board.at(self.clock, self._poll)

    def buttons_ack(self, count: int) -> None:
        """So many reports have come."""
        self.acknowledged = self.acknowledged + count & 0xFF
        del self.reports[:count]
        if not self.reports:
            self.countdown = -1

    def pin_changed(self, pin: str, level: bool, tick: int) -> None:
        """The next poll on the grid looks."""
        if self.rest and pin in self.pins and not self._timer[0]:
            steps = -(-(max(tick, self.clock) - self.clock) // self.rest)
            self._timer = self.board.at(self.clock + steps * self.rest, self._poll, check=False)

    def _poll(self, tick: int) -> None:
        self.clock = tick
        status = sum(1 << i for i, pin in enumerate(self.pins) if pin is not None and self.board.machine.level(pin))
        changed = (status ^ self.pressed) & ~(status ^ self.last)
        if changed:
            self.pressed ^= changed
            if len(self.reports) < 8:
                self.reports.append(self.pressed)
                self._tell()
        elif self.countdown >= 0:
            self.countdown -= 1
            if self.countdown < 0 and self.reports:
                self._tell()
        self.last = status
        if status != self.pressed or self.countdown >= 0:
            self._timer = self.board.at(tick + self.rest, self._poll, check=False)

    def _tell(self) -> None:
        self.countdown = self.retransmit
        self.board.respond("buttons_state", oid=self.oid, ack_count=self.acknowledged, state=bytes(self.reports))

    def shut_down(self) -> None:
        """Its timer is gone."""
        self._timer = [False]
        self.rest = 0


_MAKERS: Mapping[str, Callable[..., Part]] = {
    "config_stepper": Stepper,
    "config_endstop": Endstop,
    "config_trsync": Trsync,
    "config_digital_out": DigitalOut,
    "config_buttons": Buttons,
    "config_tmcuart": chips.uart,
    "config_spi": chips.spi,
}


def make(board: Home, command: str, values: Mapping[str, Any]) -> Part:
    """What a config command asks for."""
    return _MAKERS[command](board, **{key: value for key, value in values.items() if key != "oid"})
