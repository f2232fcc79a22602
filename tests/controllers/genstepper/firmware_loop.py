"""What the firmware does to one motor, tick by tick and command by command: the witness for exact motion.

Written from the manual and from how it is read (docs/controllers/genstepper.md), without segments or closed forms.
"""

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
        self.steps: list[tuple[int, int]] = []

    # commands, between two ticks

    def go(self, target):
        self.target = target
        if self.state == "idle":
            self.begin_go()
        else:
            self.begin_stop(("go",))

    def go_relative(self, steps):
        going = self.state == "go" or self.next == ("go",)
        self.go((self.target if going else self.position) + steps)

    def slew(self, direction):
        if self.state == "idle":
            self.begin_slew(direction)
        elif self.direction == direction:
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

    def begin_go(self):
        distance = self.target - self.position
        self.state, self.next = "idle", None
        if distance:
            self.state, self.direction = "go", 1 if distance > 0 else -1
            self.go_rate, self.go_keep, self.go_slope = self.rate, self.keep, self.slope
            self.speed, self.travel = min(self.keep, self.rate) * PER_SECOND, 0
            self.braking = False

    def begin_slew(self, direction):
        self.state, self.direction, self.next = "slew", direction, None
        self.speed, self.travel = min(self.keep, self.rate) * PER_SECOND, 0

    def begin_stop(self, then):
        self.state, self.next = "stop", then
        self.maybe_stopped()

    def maybe_stopped(self):
        if self.speed <= self.keep * PER_SECOND:
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
            v = max(v - self.slope, self.keep * PER_SECOND)
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
