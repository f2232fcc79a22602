"""A closed limit is never passed by more than the manual's own ramp-down, whatever is typed or pressed meanwhile."""

from random import Random

import pytest
from tests.controllers.laws.adapter import Limit, Model, history, ready
from tests.controllers.laws.bench import Action, Bench, Put, Wait, Watch
from tests.controllers.laws.histories import ORDINARY, THOROUGH, History, hold
from tests.controllers.laws.models import every_model

from detent.pins import LOW
from detent.ticks import MS, SECOND, Ns


class Guard(Watch):
    """Looks whether a limit is passed: counts the steps towards it since it closed."""

    def __init__(self, limit: Limit) -> None:
        self.limit = limit
        self.met = 0  # how often it closed on an axis that moved towards it
        self._closed = False
        self._on_its_way = 0  # the direction in which the axis met it, until it comes to rest or turns
        self._at: Ns = 0  # since when it is closed
        self._place = 0  # where the axis was then
        self._rate = 0.0
        self._allowed = 0
        self._ends = 0  # motions of the axis that were over when it was met
        self._was = 0, 0.0  # the direction and rate before what happens now

    def before(self, bench: Bench) -> None:
        travel = bench.travels[self.limit.axis]
        if self._on_its_way and not self._closed:  # it has opened again, and something new comes
            self._on_its_way, self._allowed, self._place = 0, 0, self._where(bench)
        towards = travel.direction if self.limit.direction in (0, travel.direction) else 0
        towards = towards if self.limit.met(bench) else 0
        self._was = towards, travel.rate(bench.now)

    def look(self, bench: Bench) -> None:
        limit, travel = self.limit, bench.travels[self.limit.axis]
        closed = limit.closed(bench)
        if self._on_its_way:
            self._allowed = max(self._allowed, limit.steps(bench, self._rate))
            self._judge(bench)
            if travel.direction != self._on_its_way or travel.ends != self._ends or (limit.gate and not closed):
                self._on_its_way, self._allowed, self._place = 0, 0, self._where(bench)
        elif closed and self._closed and limit.barred:
            self._judge(bench)
            if travel.direction != limit.direction:
                self._place = self._where(bench)
        if closed and not self._closed:
            self._at, self._place = bench.now, self._where(bench)
            self._on_its_way, self._rate = self._was
            if self._on_its_way:
                self.met += 1
                self._ends = travel.ends
                self._allowed = limit.steps(bench, self._rate)
                if travel.direction != self._on_its_way:
                    self._on_its_way = self._allowed = 0
        self._closed = closed

    def _where(self, bench: Bench) -> int:
        """Steps towards the limit; any step where it stops both ways."""
        travel = bench.travels[self.limit.axis]
        return self.limit.direction * travel.shaft(bench.now) if self.limit.direction else travel.count(bench.now)

    def _judge(self, bench: Bench) -> None:
        passed = self._where(bench) - self._place
        assert passed <= self._allowed, (
            f"{self.limit.name} closed at {self._at} ns and was passed by {passed} steps; the ramp has {self._allowed}"
        )


def a_closed_limit_is_not_passed(model: Model, past: History) -> bool:
    """By its contacts, or by one that closes ahead of an axis in motion and stays so while the host goes on."""
    bench = ready(model, past)
    guards = [Guard(limit) for limit in model.limits()]
    bench.watches += guards
    bench.play(past.actions)
    pins = [pin.name for pin in bench.device.pins]
    for limit in model.limits():
        if limit.direction in (0, bench.travels[limit.axis].direction) and limit.name in pins and bench.moving:
            bench.play((Put(limit.name, LOW),))
            break
    bench.play(past.later)
    bench.go_to(bench.now + 3 * SECOND)
    return any(guard.met for guard in guards)


def check(model: Model, count: int) -> None:
    def make(draw: Random) -> tuple[History, None]:
        past = history(model, draw, 16)
        contacts = next((found for _ in range(9) if (found := model.contacts(draw))), ())
        later: list[Action] = []
        for _ in range(draw.randrange(4)):
            later += (*model.actions(draw), Wait(draw.choice((0, 1 * MS, 9 * MS, 40 * MS))))
        return past._replace(contacts=contacts, later=tuple(later)), None

    told = hold(lambda past, _: a_closed_limit_is_not_passed(model, past), make, count, f"limits of {model.name}")
    assert told > count // 10


@every_model("limits")
def test_a_closed_limit_is_not_passed(model: Model) -> None:
    check(model, ORDINARY)


@pytest.mark.slow
@every_model("limits")
def test_a_closed_limit_is_not_passed_in_many_more_histories(model: Model) -> None:
    check(model, THOROUGH)
