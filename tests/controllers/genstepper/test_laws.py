"""Laws that hold after any history: a stop leads to rest, a closed limit is not passed, = moves nothing, held keys win.

Pages 12, 20 to 22, 27, 33, 36, 38 and 60 of the manual.
"""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.controllers.genstepper.histories import KEYS, LIMITS, OFF_AND_ON, Life, calm, histories, turnings
from tests.generated import examples

from detent.controllers.device import DriveSet
from detent.controllers.genstepper.inputs import Keys, keys
from detent.ticks import MS, SECOND
from detent.uart import Sent

FEW = settings(max_examples=examples(100), deadline=None, suppress_health_check=list(HealthCheck))
MANY = settings(max_examples=10_000, deadline=None, suppress_health_check=list(HealthCheck))
TICK = 16_000

BOARDS = {hard: Life(hard_stop=hard) for hard in (False, True)}


def fresh(hard: bool = False) -> Life:
    return BOARDS[hard].copy()


def law(check):
    """A few histories in every run, ten thousand in the long one."""

    def decorate(*strategies):
        few = FEW(given(*strategies)(check))
        many = pytest.mark.slow(MANY(given(*strategies)(check)))
        return few, many

    return decorate


# -- a stop leads to rest ----------------------------------------------------------------------------------------


def a_stop_leads_to_rest(history, stop, hard):
    life = fresh(hard)
    life.live(history)
    for key in KEYS:
        life.do((key, 1))
    if stop in ("limits", "momentary"):
        if life.board._direct.on:
            life.do("0E")  # which would stop the motors at once
        life.do("0T")
        for limit in LIMITS:
            life.do((limit, 1))
        for limit in LIMITS:
            life.do((limit, 0))
        for limit in LIMITS if stop == "momentary" else ():
            life.do((limit, 1))
    else:
        life.do(stop)
    longest = max(life.ramp(axis) for axis in "XY")
    assert longest == 0 or stop not in ("!", "1E0E"), "at once (pages 20, 37)"
    life.run(longest)
    assert life.idle()
    before = [life.board.status(life.now, axis).pulses for axis in "XY"]
    life.do(("NXT", 0))
    for limit in LIMITS:
        life.do((limit, 1))
    life.run(5 * SECOND)
    assert [life.board.status(life.now, axis).pulses for axis in "XY"] == before, "what was pending stays away"
    assert life.idle()


hard_stops = st.sampled_from([False, False, False, True])
stops = st.sampled_from(["BZ", "5BZ", "B7=", "limits", "momentary", "momentary", "momentary", "!", "1E0E"])
test_a_stop_leads_to_rest, test_a_stop_leads_to_rest_many_times = law(a_stop_leads_to_rest)(
    st.one_of(turnings(), histories), stops, hard_stops
)


# -- a closed limit is never passed --------------------------------------------------------------------------------


class Watch:
    """What a closed limit still allows, by nothing but what was said and pressed."""

    def __init__(self, life: Life) -> None:
        self.life = life
        self.allowed: dict[str, tuple[int, float]] = {}  # of a closed limit: steps when it closed, and how many more

    def closed(self) -> set[str]:
        life = self.life
        if life.board._direct.on:
            return set()
        mask = life.board._limits._mask
        return {
            limit
            for place, limit in enumerate(("LY-", "LY+", "LX-", "LX+"))
            if not mask >> place & 1 and life.board._inputs[limit] == mask >> place + 4 & 1
        }

    def towards(self, limit: str) -> int:
        way = 1 if limit[2] == "+" else -1
        return sum(direction == way for _, direction in self.life.steps(limit[1]))

    def look(self, before: dict[str, tuple[bool, int, int, int, int]]) -> None:
        """After an action: `before` it each motor was at rest or not, with direction, speed, P and K."""
        closed = self.closed()
        for limit in set(self.allowed) - closed:
            del self.allowed[limit]
        for limit in closed - set(self.allowed):
            idle, direction, speed, slope, keep = before[limit[1]]
            towards = not idle and direction == (1 if limit[2] == "+" else -1)
            ramp = max(speed + 1 - keep, 0)
            # v2 / 2P on the way down, a tick at K, and what is left of a microstep
            room = ramp * (speed + 1 + keep) / (2 * slope) + (speed + 1) / 62_500 + 1 if towards else 0
            self.allowed[limit] = self.towards(limit), 0 if self.life.board._limits.hard else room

    def check(self) -> None:
        for limit, (begun, room) in self.allowed.items():
            assert self.towards(limit) - begun <= room, limit


def seen(life: Life) -> dict[str, tuple[bool, int, int, int, int]]:
    found = {}
    for axis in "XY":
        motor = life.motor(axis)
        floor = motor._floor  # of a stop at a limit that has opened again
        found[axis] = (motor.idle, motor.direction, motor.speed(life.now), max(motor.slope, floor[0]),
                       max(motor.keep, floor[1]))  # fmt: skip
    return found


def a_closed_limit_is_never_passed(history, hard):
    life = fresh(hard)
    watch = Watch(life)
    for action, wait in history:
        parts = list(action) if isinstance(action, str) and action != OFF_AND_ON else [action]
        for part in parts:
            before = seen(life)
            life.do(part)
            if part in ("!", OFF_AND_ON):
                watch.allowed.clear()
            watch.look(before)
        life.run(wait)
        watch.check()
    life.run(3 * SECOND)
    watch.check()


test_a_closed_limit_is_never_passed, test_a_closed_limit_is_never_passed_many_times = law(
    a_closed_limit_is_never_passed
)(histories, hard_stops)


# -- redefining a position moves nothing ---------------------------------------------------------------------------


def set_position_is_a_stop_and_moves_nothing(history, number, axes, then):
    life = fresh()
    life.live(history)
    told, twin = life, life.copy()
    where = {axis: twin.board.status(life.now, axis).position for axis in "XY"}
    rotors = {axis: life.motor(axis).field(life.now) for axis in "XY"}
    told.do(f"{axes}{number}=")
    twin.do(f"{axes}{number}Z")
    chosen = "XY" if axes == "B" else axes
    for axis in chosen:
        assert told.board.status(told.now, axis).position == number
        assert told.motor(axis).field(told.now) == rotors[axis]
    shift = {axis: number - where[axis] if axis in chosen else 0 for axis in "XY"}
    for _ in range(3):
        told.run(then)
        twin.run(then)
        for axis in "XY":
            assert told.steps(axis) == twin.steps(axis), "no pulse"
            assert told.board.duties(axis, told.now) == twin.board.duties(axis, twin.now), "no winding"
            here = told.board.status(told.now, axis).position
            assert here == twin.board.status(twin.now, axis).position + shift[axis], "counter and shaft agree"
            assert f"{axis},-1,{here}" in said(told, f"{axis}-1?"), "and what is reported"
            assert said(told, f"{axis}125?") == said(twin, f"{axis}125?"), "the rotor"
    drives = [[entry for entry in each.out if isinstance(entry, DriveSet)] for each in (told, twin)]
    assert drives[0] == drives[1]


def said(life: Life, text: str) -> str:
    twin = life.copy()
    begun = len(twin.out)
    twin.do(text)
    twin.run(2 * MS)
    return "".join(chr(entry.char.value) for entry in twin.out[begun:] if isinstance(entry, Sent))


test_set_position_moves_nothing, test_set_position_moves_nothing_many_times = law(
    set_position_is_a_stop_and_moves_nothing
)(calm, st.integers(-500, 500), st.sampled_from("XYB"), st.sampled_from([TICK, 40 * MS, 2 * SECOND]))


# -- keys are levels -----------------------------------------------------------------------------------------------


def a_held_key_wins(history, axis, held):
    life = fresh()
    life.live(history)
    life.do("0E")
    life.run(300 * MS)
    for limit in LIMITS:
        life.do((limit, 1))
    life.do("0T")
    life.do("B62500P")
    for sign in "+-":
        life.do((axis + sign, 0 if sign in held else 1))
    life.live(history_of_typing := [(action, wait) for action, wait in history if isinstance(action, str)
                                    and action[-1] not in "ETKPR!" and action != OFF_AND_ON])  # fmt: skip
    life.run(3 * SECOND)
    asked = keys(life.board._inputs, axis)
    motor = life.motor(axis)
    begun = motor.position(life.now)
    life.run(SECOND)
    moved = motor.position(life.now) - begun
    if asked.value:
        assert moved * asked.value >= 15, history_of_typing
    elif asked is Keys.BOTH:
        assert moved == 0, "both of a pair stop"


test_a_held_key_wins, test_a_held_key_wins_many_times = law(a_held_key_wins)(
    histories, st.sampled_from("XY"), st.sampled_from(["+", "-", "+-"])
)
