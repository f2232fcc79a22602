"""Every pulse of a move against the plain model, whatever Z, K, ENABLE and inputs do to it in whichever phase.

The specification page, "Moves", "K", "Z", "ENABLE", "Velocity mode"; datasheet, "Pin description" 22-28.
"""

from decimal import Decimal

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.controllers.gsc200 import pulse_model
from tests.controllers.gsc200.pulse_model import Event, Move
from tests.generated import examples

from detent.axis import MotionCut, MotionEnded, MotionStarted
from detent.cell.recording import Recording
from detent.controllers.gsc200.firmware import GsC200
from detent.pins import PinSet
from detent.ticks import SECOND, US
from detent.uart import Char

HALF = Decimal("0.5") + Decimal(2) ** -55  # a held pulse moves the rest of its train by whole units of 2**-60 ns
SETTINGS = {"deadline": None, "suppress_health_check": list(HealthCheck)}


def module(watched: bool) -> GsC200:
    made = GsC200("gs-c200s", {"CHS": 0}, line_timing=False, instruction_time=1 * US)
    if watched:
        made.watch("CLOCK")
    return made


def say(made: GsC200, text: str, now: int) -> None:
    made.receive("RXD", [Char(ord(letter)) for letter in text + "\r"], now)


def go_to(made: GsC200, instant: int) -> None:
    while (deadline := made.next_deadline()) is not None and deadline <= instant:
        made.advance(deadline)


def played(move: Move, direction: int, events: list[Event], until: int, *, enabled: bool, watched: bool):
    """Outputs of the firmware for the same move, begun at 1 s."""
    made = module(watched)
    made.power(True, 0)
    for number, text in enumerate((f"S{move.start_stop // 10}", f"T{move.slew // 10}", f"R{move.ramp}"), 1):
        go_to(made, number * 1000 * US)
        say(made, text, number * 1000 * US)
    go_to(made, SECOND)
    made.set_pin("ENABLE", int(enabled), SECOND)
    made.drain()
    sign = "+" if direction > 0 else "-"
    say(made, f"{sign}{move.steps}" if move.steps else f"g{sign}{'1' if move.has_stop else ''}", SECOND)
    for event in events:
        go_to(made, event.at)
        if event.kind in ("Z", "K"):
            say(made, event.kind, event.at)
        else:
            made.set_pin({"ENABLE": "ENABLE", "stop": "UI1"}[event.kind], event.level, event.at)
    go_to(made, until)
    return made, made.drain()


def pulse_times(out: list, until: int) -> list[int]:
    recording = Recording(["unit"])
    recording.extend(0, [item for item in out if isinstance(item, (MotionStarted, MotionCut, MotionEnded))])
    spans = recording.motion("unit", until)
    return [span.train.time_of(pulse) for span in spans for pulse in range(span.first, span.last + 1)]


def edges(out: list, pin: str) -> list[tuple[int, int]]:
    return [(item.at, item.level) for item in out if isinstance(item, PinSet) and item.pin == pin]


def check(move: Move, direction: int, events: list[Event], *, enabled: bool, watched: bool) -> None:
    last = max((event.at for event in events), default=0)
    until = max(last, SECOND) + 3 * SECOND
    told = pulse_model.play(move, SECOND, events, until, enabled=enabled)
    made, out = played(move, direction, events, until, enabled=enabled, watched=watched)
    times = pulse_times(out, until)
    assert len(times) == len(told.pulses)
    for number, (found, exact) in enumerate(zip(times, told.pulses, strict=True), 1):
        assert abs(found - exact) <= HALF, f"pulse {number} at {found} instead of {exact}"
    assert edges(out, "MOV") == [(at, level) for at, _, level in told.mov]
    assert edges(out, "RAMP") == [(at, level) for at, _, level in told.ramp]
    assert edges(out, "DIR") == ([] if direction > 0 else [(SECOND, 0)])
    assert made.status(until).pulses == len(times)
    assert made.status(until).position == direction * len(times)
    if watched:
        falls = [(at, level) for at, level in edges(out, "CLOCK") if level == 0]
        assert falls == [(at, 0) for at in times]
        rises = [at for at, level in edges(out, "CLOCK") if level == 1]
        assert rises == [at + 1700 for at in times if at + 1700 <= until]


@st.composite
def moves(draw: st.DrawFn) -> Move:
    slow = draw(st.sampled_from([1, 10, 100, 1000]) | st.integers(1, 1000)) * 10
    fast = draw(st.sampled_from([1, 100, 1000]) | st.integers(1, 1000) | st.just(slow // 10)) * 10
    ramp = draw(st.sampled_from([1, 2, 3, 5, 50]) | st.integers(1, 60) | st.integers(1, 999))
    bound = max(3, min(4 * ramp + 3, 250))
    steps = draw(st.none() | st.integers(1, 3) | st.integers(1, bound) | st.sampled_from([2 * ramp, 2 * ramp + 1]))
    return Move(slow, fast, ramp, steps, steps is None and draw(st.booleans()))


@st.composite
def event_lists(draw: st.DrawFn, move: Move) -> list[Event]:
    """Events at, around and between the pulses of the undisturbed move, and anywhere."""
    horizon = SECOND + SECOND // 2
    nominal = [pulse_model.nearest(exact) for exact in pulse_model.play(move, SECOND, [], horizon).pulses][:300]
    places = st.integers(SECOND, SECOND + SECOND // 5)
    if nominal:
        beside = st.sampled_from([0, 0, -1, 1, -1000, 1000, 50_000])
        places = places | st.builds(int.__add__, st.sampled_from(nominal), beside)
    gate, stop = [("ENABLE", 0), ("ENABLE", 1)], [("stop", 0), ("stop", 1)]
    kinds = st.sampled_from([("Z", 0), ("Z", 0), ("K", 0), *gate, *gate, *stop])
    chosen = draw(st.lists(st.tuples(places, kinds), max_size=6))
    return [Event(max(at, SECOND), kind, level) for at, (kind, level) in sorted(chosen, key=lambda item: item[0])]


@settings(max_examples=examples(400), **SETTINGS)
@given(data=st.data(), direction=st.sampled_from([1, -1]), enabled=st.sampled_from([True, True, True, False]))
def test_every_pulse_comes_when_the_specification_says(data: st.DataObject, direction: int, enabled: bool) -> None:
    move = data.draw(moves())
    check(move, direction, data.draw(event_lists(move)), enabled=enabled, watched=data.draw(st.booleans()))


@pytest.mark.slow
@settings(max_examples=2000, **SETTINGS)
@given(data=st.data(), direction=st.sampled_from([1, -1]), enabled=st.sampled_from([True, True, True, False]))
def test_every_pulse_comes_when_the_specification_says_at_length(
    data: st.DataObject, direction: int, enabled: bool
) -> None:
    move = data.draw(moves())
    check(move, direction, data.draw(event_lists(move)), enabled=enabled, watched=data.draw(st.booleans()))


@pytest.mark.parametrize("kind", ["Z", "K", "stop"])
@pytest.mark.parametrize("steps", [1, 2, 3, 10, 11, 20, 21, 30, None])
def test_a_stop_at_each_pulse_of_a_move_and_between_them(kind: str, steps: int | None) -> None:
    """Z, K and the input, in up ramp, slew, down ramp, and at the peak of short odd moves."""
    move = Move(100, 1000, 10, steps, has_stop=steps is None)
    nominal = pulse_model.play(move, SECOND, [], SECOND + SECOND // 10).pulses[:40]
    for exact in [Decimal(SECOND), *nominal]:
        for beside in (-1, 0, 1, 300_000):
            at = max(pulse_model.nearest(exact) + beside, SECOND)
            check(move, 1, [Event(at, kind)], enabled=True, watched=False)


@pytest.mark.parametrize("steps", [1, 2, 3, 10, 11, 20, 21, 30])
@pytest.mark.parametrize("stop", ["", "Z", "K"])
def test_a_hold_at_each_pulse_of_a_move_with_and_without_a_stop_in_it(steps: int, stop: str) -> None:
    """Pin 24: a pulse that falls due is held, and is given at ENABLE high; later intervals count from it."""
    move = Move(100, 1000, 10, steps)
    nominal = pulse_model.play(move, SECOND, [], 2 * SECOND).pulses
    for exact in [Decimal(SECOND), *nominal]:
        at = pulse_model.nearest(exact)
        events = [Event(at, "ENABLE", 0), Event(at + 50_000_000, "ENABLE", 1)]
        if stop:
            events.insert(1, Event(at + 30_000_000, stop))
        check(move, -1, events, enabled=True, watched=False)


@pytest.mark.parametrize("period_ns", [900_001, 1_000_000, 1_333_333])
def test_a_move_under_an_external_rhythm_on_enable(period_ns: int) -> None:
    """Pin 24: "to execute the motion according to externally generated timing"."""
    move = Move(100, 2000, 7, 60)
    events = []
    for beat in range(120):
        at = SECOND + beat * period_ns
        events += [Event(at, "ENABLE", 1), Event(at + 1, "ENABLE", 0)]
    events.append(Event(SECOND + 120 * period_ns, "ENABLE", 1))
    for watched in (False, True):
        check(move, 1, events, enabled=False, watched=watched)
