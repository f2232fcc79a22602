"""Redefining a position moves nothing: no pulse, no winding; counter, shaft and what is told agree afterwards."""

from collections.abc import Sequence
from random import Random

import pytest
from tests.controllers.laws.adapter import Model, Redefinition, history, ready
from tests.controllers.laws.bench import Action, Bench, Wait, Watch
from tests.controllers.laws.histories import ORDINARY, THOROUGH, History, gap, hold
from tests.controllers.laws.models import every_model

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.controllers.device import DriveSet, Refused, StageSet
from detent.ticks import Ns


class Windings(Watch):
    """What the motors get, whenever it changes: places of the field and currents, from what the device tells."""

    def __init__(self) -> None:
        self.told: list[tuple[Ns, str, object]] = []
        self._drives: dict[str, DriveSet | StageSet] = {}
        self._read = 0
        self._last: dict[str, object] = {}

    def look(self, bench: Bench) -> None:
        for item in bench.out[self._read :]:
            if isinstance(item, DriveSet | StageSet):
                self._drives[item.connector if isinstance(item, DriveSet) else item.axis] = item
        self._read = len(bench.out)
        for connector, told in self._drives.items():
            travel = bench.travels[told.axis]
            place = travel.shaft(bench.now) - told.origin
            if isinstance(told, DriveSet):
                got: object = tuple(told.drive.duties(place, int(travel.rate(bench.now))))
            else:
                got = told.stage, (told.stage.start + told.stage.places * place) % 256
            if self._last.get(connector) != got:
                self._last[connector] = got
                self.told.append((bench.now, connector, got))


def redefining_moves_nothing(model: Model, past: History, way: Redefinition) -> bool:
    benches = []
    for actions in (way.actions, way.neutral):
        bench = ready(model, past)
        windings = Windings()
        bench.watches.append(windings)
        bench.play(past.actions)
        if not way.applies(bench):
            return False
        shafts = {axis: travel.shaft(bench.now) for axis, travel in bench.travels.items()}
        bench.play(actions)
        benches.append((bench, windings, shafts))
    (one, given, _), (other, expected, _) = benches
    places = {axis: (one.travels[axis].shaft(one.now), number(one, axis)) for axis in way.axes}
    for axis, (_, position) in places.items():
        moved = one.travels[axis].shaft(one.now) - benches[0][2][axis]
        off = (position - way.value) * (1 if moved >= 0 else -1) % model.modulus
        assert off <= abs(moved), f"{way.name}: the counter is {position}, not {way.value} to {way.value + moved}"
    assert pulses(one) == pulses(other), f"{way.name} gives pulses: {differing(pulses(one), pulses(other))}"
    for bench, _, _ in benches:
        bench.play(past.later)
    if beyond(one) != beyond(other):
        return False  # what has room behind the one number has none behind the other: that is said, and nothing moves
    assert pulses(one) == pulses(other), f"{way.name} gives other pulses: {differing(pulses(one), pulses(other))}"
    assert given.told == expected.told, f"{way.name} moves the field: {differing(given.told, expected.told)}"
    for axis, (shaft, position) in places.items():
        now = position + one.travels[axis].shaft(one.now) - shaft
        assert same(model, number(one, axis), now), f"the counter is {number(one, axis)}; by the shaft it is {now}"
        if not one.moving:
            before, told = number(one, axis), model.told(one, axis)
            assert told in (before, None), f"{told} is told, and the counter is {before}"
    return True


def beyond(bench: Bench) -> list[str]:
    """Moves that were refused as the counter has no such number."""
    refused = [item for item in bench.out if isinstance(item, Refused)]
    return [item.frame for item in refused if "leave the position counter" in item.reason]


def number(bench: Bench, axis: str) -> int:
    """The position counter."""
    return bench.device.status(bench.now, axis).position


def same(model: Model, one: int, other: int) -> bool:
    return (one - other) % model.modulus == 0


def pulses(bench: Bench) -> list[tuple[str, int, int, int, list[Ns]]]:
    """What the axes were given: for each motion its direction, the first and last pulse, and a few of their times."""
    found = []
    for axis in bench.travels:
        told = [item for item in bench.out if isinstance(item, MotionStarted | MotionCut | MotionEnded)]
        told = [item for item in told if item.axis == axis]
        for started, after in zip(told, (*told[1:], None), strict=False):
            if isinstance(started, MotionStarted):
                if isinstance(after, MotionCut | MotionEnded):
                    last = after.last
                else:
                    last = started.train.steps_by(bench.now if after is None else after.at)
                some = {n for n in (started.first, (started.first + last) // 2, last) if started.first <= n <= last}
                times = [started.train.time_of(n) for n in sorted(some)]
                found.append((axis, started.direction, started.first, last, times))
    return found


def differing(one: Sequence[object], other: Sequence[object]) -> object:
    return next(((a, b) for a, b in zip(one, other, strict=False) if a != b), "one has more")


def check(model: Model, count: int) -> None:
    def make(draw: Random) -> tuple[History, Redefinition]:
        way = model.redefinition(draw)
        assert way is not None
        later: list[Action] = []
        for _ in range(draw.randrange(6)):
            later += (*model.onward(draw), Wait(gap(draw)))
        return history(model, draw, 6)._replace(later=tuple(later)), way

    def law(past: History, way: Redefinition) -> bool:
        return redefining_moves_nothing(model, past, way)

    assert hold(law, make, count, f"redefining of {model.name}") > count // 10


class Counter(Watch):
    """Looks whether the counter follows the shaft, whatever happens, but for what redefines it."""

    def __init__(self, model: Model, bench: Bench) -> None:
        self._model = model
        self._offsets = {axis: self._offset(bench, axis) for axis in bench.travels}

    def before(self, bench: Bench) -> None:
        self._compare(bench)

    def look(self, bench: Bench) -> None:
        if not bench.actions or not self._model.redefines(bench):
            self._compare(bench)
        else:
            self._offsets = {axis: self._offset(bench, axis) for axis in bench.travels}

    def _compare(self, bench: Bench) -> None:
        for axis, before in self._offsets.items():
            now = self._offset(bench, axis)
            assert same(self._model, now, before), f"the counter of {axis or 'the axis'} jumps by {now - before}"

    def _offset(self, bench: Bench, axis: str) -> int:
        return number(bench, axis) - bench.travels[axis].shaft(bench.now)


def the_counter_follows_the_shaft(model: Model, past: History) -> None:
    bench = ready(model, past)
    bench.watches.append(Counter(model, bench))
    bench.play(past.actions)


def check_counter(model: Model, count: int) -> None:
    def make(draw: Random) -> tuple[History, None]:
        return history(model, draw), None

    hold(lambda past, _: the_counter_follows_the_shaft(model, past), make, count, f"counters of {model.name}")


@every_model("redefining")
def test_redefining_a_position_moves_nothing(model: Model) -> None:
    if model.redefinition(Random(0)) is not None:
        check(model, ORDINARY // 2)


@every_model("counters")
def test_the_counter_follows_the_shaft(model: Model) -> None:
    check_counter(model, ORDINARY // 2)


@pytest.mark.slow
@every_model("redefining")
def test_redefining_a_position_moves_nothing_in_many_more_histories(model: Model) -> None:
    if model.redefinition(Random(0)) is not None:
        check(model, THOROUGH)


@pytest.mark.slow
@every_model("counters")
def test_the_counter_follows_the_shaft_in_many_more_histories(model: Model) -> None:
    check_counter(model, THOROUGH)
