"""What may happen to a board, as histories: what is typed, switches, keys, power; and the board that lives them.

Everything reaches the device itself, without a line, so that a history costs little. Actions are typed text, `(pin,
level)` and `"off and on"`; between two of them some time passes, often none.
"""

import copy
from typing import TypeAlias

from hypothesis import strategies as st

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.controllers.device import Output
from detent.controllers.genstepper.firmware import GenStepper
from detent.ticks import MS, SECOND, Ns
from detent.uart import Char

Action: TypeAlias = str | tuple[str, int]
History: TypeAlias = list[tuple[Action, Ns]]

OFF_AND_ON = "off and on"
LIMITS = ("LX-", "LX+", "LY-", "LY+")
KEYS = ("X-", "X+", "Y-", "Y+")

small = st.integers(-400, 400).map(str)
motors = st.sampled_from(["", "", "X", "Y", "B"])
letters = st.one_of(
    st.builds(str.__add__, small, st.sampled_from("GGS=")),
    st.sampled_from(["+S", "-S", "+S", "-S", "Z", "S", "G", "1M", "0M", "I", "?", "-8?", "L"]),
    st.builds(str.__add__, st.sampled_from(["30", "200", "800", "4000", "62500"]), st.just("R")),
    st.builds(str.__add__, st.sampled_from(["900", "5000", "20000", "62500"]), st.just("P")),
    st.builds(str.__add__, st.sampled_from(["20", "80", "500"]), st.just("K")),
    st.builds(str.__add__, st.sampled_from("0123"), st.sampled_from("OWH")),
)
typed = st.builds(str.__add__, motors, letters)
rare = st.sampled_from(["1E", "2E", "0E", "0E", "0T", "2T", "15T", "48T", "0T", "!", "4!", OFF_AND_ON])
levels = st.sampled_from([0, 0, 1])
limits = st.tuples(st.sampled_from(LIMITS), levels)
keys = st.tuples(st.sampled_from(KEYS), levels)
taps = st.tuples(st.just("NXT"), levels)
gaps = st.sampled_from([0, 0, 16_000, 40 * MS, 300 * MS]) | st.integers(0, 120 * MS)

ordinary = st.one_of(typed, typed, typed, limits, limits, keys, taps)
some = st.lists(st.tuples(st.one_of(ordinary, ordinary, ordinary, rare), gaps), max_size=12)
calm = st.lists(st.tuples(st.one_of(typed, typed, limits, keys, taps), gaps), max_size=10)
"""Histories without a reset and without E mode."""


@st.composite
def encounters(draw: st.DrawFn) -> History:
    """A motor on its way, perhaps about to turn, meets a limit; at once or a little later something else comes."""
    axis, way = draw(st.sampled_from("XY")), draw(st.sampled_from("+-"))
    far = "1" if way == "+" else "-1"
    short = st.sampled_from([0, 16_000, 10 * MS, 40 * MS, 100 * MS])
    story: History = [(f"{axis}{draw(st.sampled_from(['', '2000R', '8000R900P']))}", 0)]
    begin = draw(st.sampled_from([f"{axis}{way}S", f"{axis}{far}5000G", (f"{axis}{way}", 0)]))
    story.append((begin, draw(st.sampled_from([100 * MS, 400 * MS]))))
    on = st.sampled_from([f"{axis}{way}S", f"{axis}{far}9000G", f"{axis}{far}000S", (f"{axis}{way}", 0)])
    else_ = [f"{axis}0G", "Z", "S", "-S", "+S", "7=", "1P", "1K", "900P", "1M", (f"{axis}{way}", 1), ("NXT", 0)]
    again = st.one_of(on, on, st.sampled_from(else_))
    if draw(st.booleans()):
        story.append((draw(again), draw(short)))
    story.append(((f"L{axis}{way}", 0), draw(short)))
    if draw(st.sampled_from([False, False, True])):
        story.append(((f"L{axis}{way}", 1), draw(short)))
    story += draw(st.lists(st.tuples(again, short), min_size=1, max_size=4))
    return story


@st.composite
def turnings(draw: st.DrawFn) -> History:
    """A motor on its way is given something else to do after its stop, and is still on its way to that stop."""
    axis, way = draw(st.sampled_from("XY")), draw(st.sampled_from("+-"))
    begin = draw(st.sampled_from([f"{way}S", f"{way}5000G"]))
    then = draw(st.sampled_from([f"{way}9000G", "0G", "+S", "-S", f"{way}700S", "1M", "Z"]))
    return [(f"{axis}2000R{begin}", 400 * MS), (then, draw(st.sampled_from([0, 10 * MS, 100 * MS])))]


histories = st.one_of(some, encounters(), turnings(), st.builds(list.__add__, some, encounters()))


class Life:
    """A board that has signed on, and the steps of each motor: (time, direction)."""

    def __init__(self, **order: object) -> None:
        self.board = GenStepper("bs0610", line_timing=False, **order)
        self.now: Ns = 0
        self.out: list[Output] = []
        self.board.power(True, 0)
        self.run(300 * MS)

    def copy(self) -> "Life":
        twin = copy.copy(self)
        twin.board, twin.out = copy.deepcopy(self.board), list(self.out)
        return twin

    def run(self, time: Ns) -> None:
        self.now += time
        self.board.advance(self.now)
        self.out += self.board.drain()

    def do(self, action: Action) -> None:
        if action == OFF_AND_ON:
            self.board.power(False, self.now)
            self.board.power(True, self.now)
        elif isinstance(action, str):
            self.board.receive("SI", [Char(ord(letter)) for letter in action], self.now)
        else:
            self.board.set_pin(*action, self.now)
        self.out += self.board.drain()

    def live(self, history: History) -> None:
        for action, wait in history:
            self.do(action)
            self.run(wait)

    def steps(self, axis: str) -> list[tuple[Ns, int]]:
        """All steps so far."""
        found: list[tuple[Ns, int]] = []
        train, first, way = None, 1, 1
        for entry in self.out:
            if not isinstance(entry, (MotionStarted, MotionCut, MotionEnded)) or entry.axis != axis:
                continue
            if train is not None:
                last = entry.first - 1 if isinstance(entry, MotionStarted) else entry.last
                found += [(at, way) for at in train.times(first, last).tolist()] if last >= first else []
                train = None
            if isinstance(entry, MotionStarted):
                train, first, way = entry.train, entry.first, entry.direction
        if train is not None and (last := int(train.steps_by(self.now))) >= first:
            found += [(at, way) for at in train.times(first, last).tolist()]
        return found

    def motor(self, axis: str):
        return self.board._motors[axis]

    def idle(self) -> bool:
        return all(self.motor(axis).idle for axis in "XY")

    def ramp(self, axis: str) -> Ns:
        """How long a ramp from the present speed down to the stop OK rate takes at most."""
        motor = self.motor(axis)
        if motor.idle:
            return 0
        slope, keep = motor.slope, motor.keep
        return max(motor.speed(self.now) + 1 - keep, 0) * SECOND // slope + 3 * 16_000
