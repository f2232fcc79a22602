"""The laws that every device obeys, whatever reaches it: the suite that each of them joins.

A device joins by a `Candidate` in `test_conformance.py`: how it is made, and what may reach it. Inputs are
generated; each law is a function that takes a candidate and a schedule of inputs. The laws are the contract of
`detent.controllers.device`:

* bytes: output does not depend on how the characters of one instant are sliced into calls of `receive`;
* time: output does not depend on how the time between two events is sliced into calls of `advance`;
* copies: a copy taken at any moment goes on as the device itself would, and neither notices the other;
* deadlines lie ahead, and there are not too many of them;
* outputs come in the order of time, once each.
"""

import copy
from collections.abc import Callable, Iterator, Sequence
from itertools import cycle
from typing import NamedTuple, TypeAlias

from hypothesis import strategies as st

from detent.controllers.device import Device, Output, StoreImage
from detent.pins import Level
from detent.ticks import MS, SECOND, Ns
from detent.uart import Char


class Received(NamedTuple):
    """Characters reach the serial port, all in one instant."""

    chars: tuple[Char, ...]


class PinTo(NamedTuple):
    """An input takes a level."""

    pin: str
    level: Level


class Power(NamedTuple):
    """The supply is switched."""

    on: bool


Action: TypeAlias = Received | PinTo | Power
Schedule: TypeAlias = list[tuple[Ns, Action]]
"""Inputs, each with the time that passes before it."""


class Candidate(NamedTuple):
    """A device that joins the suite, and what may reach it.

    `frames` are what a host may send: each is characters with the pause before every one of them. `pins` are its
    inputs. `gaps` are pauses between inputs. `most_per_second` bounds its deadlines in a virtual second.
    """

    name: str
    make: Callable[[], Device]
    frames: st.SearchStrategy[list[tuple[Ns, Char]]] | None
    pins: Sequence[str]
    port: str = ""
    gaps: st.SearchStrategy[Ns] = st.sampled_from([0, 0, 0, 1, 1 * MS, 300 * MS, 20 * SECOND]) | st.integers(0, 30 * MS)
    most_per_second: int = 30_000


def schedules(candidate: Candidate) -> st.SearchStrategy[Schedule]:
    """Schedules of inputs for a candidate; the supply is switched on before the first."""
    kinds: list[st.SearchStrategy[list[tuple[Ns, Action]]]] = []
    if candidate.frames is not None:
        frames = candidate.frames.map(lambda frame: [(gap, Received((char,))) for gap, char in frame])
        kinds += [frames, frames, frames]
    if candidate.pins:
        kinds.append(st.builds(PinTo, st.sampled_from(candidate.pins), st.sampled_from([0, 1])).map(_alone))
    power = st.lists(st.sampled_from([True, False, True]), min_size=1, max_size=3)
    piece = st.one_of(*kinds)
    rare = st.one_of(*kinds, *kinds, power.map(lambda ons: [(0, Power(on)) for on in ons]))
    return st.lists(st.tuples(candidate.gaps, st.one_of(piece, piece, piece, rare)), max_size=25).map(_flat)


def _alone(action: Action) -> list[tuple[Ns, Action]]:
    return [(0, action)]


def _flat(pieces: list[tuple[Ns, list[tuple[Ns, Action]]]]) -> Schedule:
    schedule: Schedule = [(0, Power(True))]
    for gap, actions in pieces:
        for index, (before, action) in enumerate(actions):
            schedule.append((before + (0 if index else gap), action))
    return schedule


class Run:
    """A device on its way through a schedule. Checks at every step what must hold at every step."""

    def __init__(self, candidate: Candidate, device: Device, *, slices: Sequence[float] = ()) -> None:
        self.candidate, self.device = candidate, device
        self.slices: Iterator[float] | None = cycle(slices) if slices else None
        self.now: Ns = 0
        self.out: list[Output] = []
        self.stores = 0
        self.deadlines = 0

    def fork(self) -> "Run":
        """The same run with a copy of the device."""
        twin = Run(self.candidate, copy.deepcopy(self.device))
        twin.now, twin.stores, twin.deadlines = self.now, self.stores, self.deadlines
        twin.out = list(self.out)
        return twin

    def collect(self) -> None:
        """Take what the device did, and answer what it stores: every third writing fails."""
        while out := self.device.drain():
            for item in out:
                assert item.at <= self.now, f"{item} lies in the future of {self.now}"
                assert not self.out or item.at >= self.out[-1].at, f"{item} comes after {self.out[-1]}"
                self.out.append(item)
            for item in out:
                if isinstance(item, StoreImage):
                    self.stores += 1
                    self.device.stored(self.stores % 3 != 0, self.now)
        deadline = self.device.next_deadline()
        assert deadline is None or deadline >= self.now, f"deadline {deadline} is over at {self.now}"

    def go_to(self, instant: Ns) -> None:
        """Let everything happen up to and including `instant`."""
        while True:
            deadline = self.device.next_deadline()
            until = instant if deadline is None else min(deadline, instant)
            if self.slices is not None:  # calls that nothing demands
                part = next(self.slices)
                self.now += int((until - self.now) * part)
                self.device.advance(self.now)
                self.collect()
                deadline = self.device.next_deadline()
            if deadline is None or deadline > instant:
                break
            self.now = deadline
            self.device.advance(deadline)
            self.deadlines += 1
            self.collect()
        self.now = instant
        most = 1_000 + self.candidate.most_per_second * (instant // SECOND + 1)
        assert self.deadlines <= most, f"{self.deadlines} deadlines in {instant} ns"

    def do(self, action: Action) -> None:
        """Let one thing reach the device, now."""
        match action:
            case Received(chars):
                self.device.receive(self.candidate.port, chars, self.now)
            case PinTo(pin, level):
                self.device.set_pin(pin, level, self.now)
            case Power(on):
                self.device.power(on, self.now)
        self.collect()

    def play(self, schedule: Schedule, then: Ns = 2 * SECOND) -> list[Output]:
        """Play a whole schedule and let `then` pass; return all outputs."""
        for gap, action in schedule:
            self.go_to(self.now + gap)
            self.do(action)
        self.go_to(self.now + then)
        assert self.device.drain() == []
        return self.out


def play(candidate: Candidate, schedule: Schedule, slices: Sequence[float] = ()) -> list[Output]:
    """All outputs of a fresh device."""
    return Run(candidate, candidate.make(), slices=slices).play(schedule)


def together(schedule: Schedule) -> Schedule:
    """The same schedule with the characters of one instant in one call."""
    joined: Schedule = []
    for gap, action in schedule:
        if gap == 0 and joined and isinstance(action, Received) and isinstance(before := joined[-1][1], Received):
            joined[-1] = (joined[-1][0], Received(before.chars + action.chars))
        else:
            joined.append((gap, action))
    return joined


# -- the laws --------------------------------------------------------------------------------------------------


def output_does_not_depend_on_how_characters_are_sliced(candidate: Candidate, schedule: Schedule, cut: int) -> None:
    whole = together(schedule)
    apart: Schedule = []
    for gap, action in whole:
        if isinstance(action, Received) and len(action.chars) > 1:
            at = cut % len(action.chars)
            apart += [(gap, Received(action.chars[:at])), (0, Received(action.chars[at:]))]
        else:
            apart.append((gap, action))
    expected = play(candidate, schedule)
    assert play(candidate, whole) == expected
    assert play(candidate, apart) == expected


def output_does_not_depend_on_how_time_is_sliced(
    candidate: Candidate, schedule: Schedule, slices: Sequence[float]
) -> None:
    assert play(candidate, schedule, slices) == play(candidate, schedule)


def copies_go_on_alike(candidate: Candidate, schedule: Schedule, at: int, other: Schedule) -> None:
    at %= len(schedule) + 1
    expected = play(candidate, schedule)
    run = Run(candidate, candidate.make())
    for gap, action in schedule[:at]:
        run.go_to(run.now + gap)
        run.do(action)
    twin, stranger = run.fork(), run.fork()
    stranger.play(other)  # whatever it does
    assert twin.play(schedule[at:]) == expected
    later = run.fork()
    assert run.play(schedule[at:]) == expected
    assert later.play(schedule[at:]) == expected


def the_same_inputs_give_the_same_outputs(candidate: Candidate, schedule: Schedule) -> None:
    assert play(candidate, schedule) == play(candidate, schedule)
