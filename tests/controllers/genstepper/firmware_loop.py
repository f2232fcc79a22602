"""What the firmware does to one motor, tick by tick and command by command: the witness for exact motion.

Written from the manual and from how it is read (docs/controllers/genstepper.md), without segments or closed forms.
"""

import copy

from detent.ticks import US

TICK = 16 * US
PER_SECOND = 62_500


class LoopMotor:
    """Speeds in 1 / 62 500 microsteps/s, positions in 1 / 62 500**2 microsteps."""

    def __init__(self, zero: int, keep: int = 80, slope: int = 8000, rate: int = 800) -> None:
        self.zero, self.ticks = zero, 0
        self.keep, self.slope, self.rate = keep, slope, rate
        self.position = self.target = 0
        self.state, self.direction = "idle", 1
        self.speed = self.travel = 0  # travel: the fraction of a step, in the direction of motion
        self.braking = False
        self.next = None
        self.closed = {1: False, -1: False}  # the limits
        self.floor = (0, 0)  # slope and stop rate that a stop at a limit does not fall below
        self.rested = -1  # the tick at or before which it came to rest; None in motion
        self.key = None  # what slew keys ask for: a direction, 0 for both at once
        self.steps: list[tuple[int, int]] = []

    # commands, between two ticks

    def go(self, target):
        if self.key is not None:
            return
        self.target = target
        if self.state == "idle":
            self.begin_go()
        else:
            self.begin_stop(("go",))
            if self.next and self.closed[self.direction] and self.direction * (target - self.stops_at()) > 0:
                self.next = None

    def stops_at(self):
        """Where the stop under way ends: by doing it."""
        twin = copy.deepcopy(self)
        twin.next = twin.key = None
        while twin.state != "idle":
            twin.tick()
        return twin.position

    def go_relative(self, steps):
        going = self.state == "go" or self.next == ("go",)
        self.go((self.target if going else self.position) + steps)

    def slew(self, direction):
        if self.state == "idle":
            self.begin_slew(direction)
        elif self.direction == direction:
            if self.closed[direction]:
                self.begin_stop(None)
            elif self.floor != (0, 0):
                self.begin_stop(("slew", direction))
            else:
                self.state, self.next = "slew", None
        else:
            self.begin_stop(("slew", direction))

    def stop(self):
        if self.state != "idle":
            self.begin_stop(None)

    def set_keep(self, keep):
        self.keep = keep
        if self.state == "stop":
            self.maybe_stopped()

    def set_position(self, position):
        self.position = position
        self.stop()

    def limit(self, direction, closed):
        reached = closed and not self.closed[direction]
        self.closed[direction] = closed
        if reached and self.state != "idle" and self.direction == direction:
            self.floor = (self.slope, self.keep)
            self.stop()
        self.look_at_key()

    def press(self, key):
        if key != self.key:
            self.key = key
            self.note_rest()
            if not key:
                self.stop()
            elif self.state != "idle" or self.ticks > self.rested:
                self.slew(key)  # else behind a tick of rest
            self.note_rest()

    def look_at_key(self):
        """A key that is held slews again on the tick after the motor came to rest."""
        self.note_rest()
        if self.state == "idle" and self.key and self.ticks > self.rested and not self.closed[self.key]:
            self.begin_slew(self.key)
            self.note_rest()

    def note_rest(self):
        if self.state != "idle":
            self.rested = None
        elif self.rested is None:
            self.rested = self.ticks

    def begin_go(self):
        distance = self.target - self.position
        self.state, self.next = "idle", None
        if distance and not self.closed[1 if distance > 0 else -1]:
            self.state, self.direction, self.floor = "go", 1 if distance > 0 else -1, (0, 0)
            self.go_rate, self.go_keep, self.go_slope = self.rate, self.keep, self.slope
            self.speed, self.travel = min(self.keep, self.rate) * PER_SECOND, 0
            self.braking = False

    def begin_slew(self, direction):
        self.state, self.next = "idle", None
        if self.closed[direction]:
            return
        self.state, self.direction, self.floor = "slew", direction, (0, 0)
        self.speed, self.travel = min(self.keep, self.rate) * PER_SECOND, 0

    def begin_stop(self, then):
        self.state, self.next = "stop", then
        self.maybe_stopped()

    def maybe_stopped(self):
        if self.speed <= max(self.keep, self.floor[1]) * PER_SECOND:
            then, self.state, self.next = self.next, "idle", None
            if then == ("go",):
                self.begin_go()
            elif then:
                self.begin_slew(then[1])

    # time

    def tick(self):
        self.ticks += 1
        if self.state == "idle":
            return
        v = self.speed
        if self.state == "go":
            left = abs(self.target - self.position) * PER_SECOND**2 - self.travel
            kept = self.go_keep * PER_SECOND
            if not self.braking and 2 * self.go_slope * left <= v * v - kept * kept:
                self.braking = True
            if self.braking:
                v = max(v - self.slope, kept) if v > kept else v
            else:
                v = min(v + self.slope, self.go_rate * PER_SECOND)
        elif self.state == "slew":
            wanted = self.rate * PER_SECOND
            v = min(v + self.slope, wanted) if v < wanted else max(v - self.slope, wanted)
        else:
            v = max(v - max(self.slope, self.floor[0]), max(self.keep, self.floor[1]) * PER_SECOND)
        self.speed = v
        self.travel += v
        if self.travel >= PER_SECOND**2:
            self.travel -= PER_SECOND**2
            self.position += self.direction
            self.steps.append((self.zero + self.ticks * TICK, self.direction))
        if self.state == "go" and self.position == self.target:
            self.state = "idle"
        elif self.state == "stop":
            self.maybe_stopped()

    def run_to(self, now):
        """All ticks up to and including `now`."""
        while self.zero + (self.ticks + 1) * TICK <= now:
            self.tick()
            self.look_at_key()
