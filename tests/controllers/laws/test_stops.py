"""A stop leads to rest: in the time that its ramp can take, and nothing that was pending before it moves afterwards."""

from random import Random

import pytest
from tests.controllers.laws.adapter import Model, Stop, history, ready
from tests.controllers.laws.bench import Bench
from tests.controllers.laws.histories import ORDINARY, THOROUGH, History, hold
from tests.controllers.laws.models import MODELS, every_model

from detent.ticks import SECOND

Met = set[tuple[str, str]]
"""Phases in which stops have come."""


def a_stop_leads_to_rest(model: Model, past: History, stop: Stop, met: Met) -> bool:
    bench = before(model, past, stop)
    if not stop.applies(bench):
        return False
    begun, allowed, axes = bench.now, stop.allowed(bench), stop.axes(bench)
    phases = {(model.phase(bench, axis), stop.name) for axis in axes}
    bench.play((*stop.actions(bench), *past.later))
    bench.go_to(max(begun + allowed, bench.now))
    for axis in axes:
        assert not bench.travels[axis].moving, f"{stop.name} at {begun} ns: {axis or 'it'} moves {allowed} ns later"
    given = {axis: bench.travels[axis].count(bench.now) for axis in axes}
    bench.go_to(bench.now + 1000 * SECOND)
    later = {axis: bench.travels[axis].count(bench.now) for axis in axes}
    assert later == given, f"what was pending before {stop.name} at {begun} ns moved afterwards"
    told = {axis: bench.device.status(bench.now, axis).state for axis in axes}
    assert not set(told.values()) & {"running", "moving", "homing"}, f"{stop.name} at {begun} ns: it says {told}"
    met |= phases
    return True


def before(model: Model, past: History, stop: Stop) -> Bench:
    """A device behind a history, ready for a stop: no key is held that would set it off again."""
    bench = ready(model, past)
    bench.play(past.actions)
    if not stop.holding:
        bench.play(model.let_go(bench))
    return bench


def check(model: Model, count: int, only: str = "") -> Met:
    stops, met = {stop.name: stop for stop in model.stops() if only in ("", stop.name)}, Met()

    def make(draw: Random) -> tuple[History, str]:
        return history(model, draw)._replace(later=tuple(model.meanwhile(draw))), draw.choice(list(stops))

    def law(past: History, name: str) -> bool:
        return a_stop_leads_to_rest(model, past, stops[name], met)

    assert hold(law, make, count, f"stops of {model.name} {only}") > (0 if only else count // 2)
    return met


def possible(model: Model) -> Met:
    return {(phase, stop.name) for phase in model.phases for stop in model.stops() if model.meets(phase, stop)}


@every_model("stops")
def test_a_stop_leads_to_rest(model: Model) -> None:
    check(model, ORDINARY)


@pytest.mark.parametrize("model", MODELS, ids=[model.name for model in MODELS])
def test_histories_lead_to_every_phase_in_which_each_stop_can_come(model: Model) -> None:
    missing, met = possible(model), Met()
    for number in range(1500):
        past = history(model, Random(f"phases of {model.name} {number}"))
        for holding in (False, True):
            stops = [stop for stop in model.stops() if stop.holding is holding]
            if any(name == stop.name for stop in stops for _, name in missing):
                bench = before(model, past, stops[0])
                met = {(model.phase(bench, axis), stop.name) for stop in stops if stop.applies(bench)
                       for axis in stop.axes(bench)}  # fmt: skip
                assert met <= possible(model), f"{model.name}: it is said that these cannot meet"
                missing -= met
        if not missing:
            return
    raise AssertionError(f"no history of {model.name} leads to {sorted(missing)}")


@pytest.mark.slow
@every_model("stops")
def test_a_stop_leads_to_rest_in_many_more_histories(model: Model) -> None:
    met = check(model, THOROUGH)
    for phase, name in sorted(possible(model) - met):  # what they have not come upon is looked for
        met |= check(model, THOROUGH // 2, name)
        assert (phase, name) in met, f"{name} has never come in the phase {phase}"
    assert met == possible(model)
