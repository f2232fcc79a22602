"""Units under streams: what must hold of every one of them, whatever reaches it.

No exception; deadlines that are not over, and not too many of them; outputs in the order of time; as many pulses as the
counters say, each of them told by a train; a copy that goes on as the unit itself; whatever is asked of it is answered.
Behind a stream of nothing but what the manual has, a stop leads to rest in the time that the manual gives it.
"""

import copy
import re
from collections.abc import Sequence
from random import Random
from typing import Final, NamedTuple

from tests.controllers.laws.adapter import Model
from tests.controllers.laws.bench import Action, Bench, Contact, Power
from tests.controllers.laws.models import MODELS
from tests.proofs.streams import damaged_image, stream
from tests.proofs.tally import Tally, frames_of

from detent.assembler import ImageError
from detent.controllers.device import Controller, Output
from detent.ticks import SECOND

BY_NAME: Final = {model.name: model for model in MODELS}
FRAMES: Final = 60  # of a stream, about
MOST_DEADLINES: Final = 30_000  # in a second
LINGER: Final = 1000 * SECOND
_ADDRESS: Final = re.compile(r" at 0x[0-9a-f]+")


class Strict(Bench):
    """A bench that looks after every call whether the contract is kept."""

    def __init__(self, device: Controller, contacts: Sequence[Contact] = ()) -> None:
        super().__init__(device, contacts)
        self.events = 0

    def collect(self) -> None:
        place = len(self.out)
        super().collect()
        last = self.out[place - 1].at if place else 0
        for item in self.out[place:]:
            assert last <= item.at <= self.now, f"{item} comes after {last}, at {self.now}"
            last = item.at
        deadline = self.device.next_deadline()
        assert deadline is None or deadline >= self.now, f"the deadline {deadline} is over at {self.now}"
        self.events += 1
        most = 100 * len(self.actions) + 100_000 + MOST_DEADLINES * (self.now // SECOND + 1)
        assert self.events <= most, f"{self.events} events in {self.now} ns"

    def check(self) -> None:
        """The counters, and whatever a debugger and an owner ask of a unit."""
        for axis, travel in self.travels.items():
            status = self.device.status(self.now, axis)
            assert status.pulses == travel.count(self.now), f"{status.pulses} counted, {travel.count(self.now)} given"
            self.device.cuts(self.now, axis)
            self.device.switches(axis)
        self.device.registers(self.now)
        self.device.program_memory()
        assert len(self.device.kept_memory()) == len(self.device.kept_memory())
        self.device.answers(bytes(range(256)))

    def twin(self) -> "Strict":
        """The same with a copy of the device."""
        other = copy.copy(self)
        other.device = copy.deepcopy(self.device)
        other.travels = copy.deepcopy(self.travels)
        other.held, other.actions, other.out = dict(self.held), list(self.actions), list(self.out)
        other._edges, other._levels = list(self._edges), dict(self._levels)
        return other


class Case(NamedTuple):
    """A stream on a unit: how the unit is built is drawn from `number`."""

    model: str
    number: int
    actions: tuple[Action, ...]
    sound: bool = False


def made(model: Model, number: int) -> tuple[Strict, Random]:
    """The unit of a case, off, with what sits on its axes; and what the rest is drawn from."""
    draw = Random(f"{model.name} {number}")
    options, contacts = model.options(draw), model.contacts(draw)
    return Strict(model.make(options), contacts), draw


def case(name: str, number: int) -> Case:
    """The case of that number."""
    model = BY_NAME[name]
    bench, draw = made(model, number)
    sound = number % 4 == 0
    return Case(name, number, tuple(stream(model, bench.device, draw, FRAMES, sound=sound)), sound)


def check(case: Case, tally: Tally) -> None:
    """Hold everything against a case. Raises AssertionError, or what the unit raises."""
    model = BY_NAME[case.model]
    bench, _ = made(model, case.number)
    draw = Random(f"{case.model} {case.number} judged")
    if case.number % 8 == 5:  # a memory that was damaged while the supply was off
        tally.images += 1
        try:
            bench.device.restore(damaged_image(bench.device.kept_memory(), draw))
        except ImageError:
            tally.refused += 1
    bench.play((Power(True), *model.ready()))
    cut = draw.randrange(len(case.actions) + 1) if case.number % 4 == 1 else len(case.actions)
    bench.play(case.actions[:cut])
    if cut < len(case.actions):
        _goes_on_alike(bench, case.actions[cut:])
        tally.copies += 1
    elif case.sound:
        tally.stops += _leads_to_rest(model, bench, draw)
    bench.check()
    tally.frames += frames_of(case.actions)
    tally.events += bench.events
    tally.pulses += sum(bench.counts().values())
    if case.number % 20 == 3:
        again, _ = made(model, case.number)
        again.play((Power(True), *model.ready()))
        again.play(case.actions)
        assert _told(again.out) == _told(bench.out), "the same again is not the same"
        tally.replays += 1


def _goes_on_alike(bench: Strict, rest: Sequence[Action]) -> None:
    twin = bench.twin()
    bench.play(rest)
    bench.go_to(bench.now + SECOND)
    twin.play(rest)
    twin.go_to(twin.now + SECOND)
    assert _told(twin.out) == _told(bench.out), "a copy goes on otherwise"
    twin.check()


def _told(out: Sequence[Output]) -> list[str]:
    return [_ADDRESS.sub("", repr(item)) for item in out]


def _leads_to_rest(model: Model, bench: Strict, draw: Random) -> bool:
    """As in `test_stops`; whether there was something to stop."""
    stop = draw.choice(list(model.stops()))
    if not stop.holding:
        bench.play(model.let_go(bench))
    if not stop.applies(bench):
        return False
    allowed, axes, begun = stop.allowed(bench), stop.axes(bench), bench.now
    bench.play(stop.actions(bench))
    bench.go_to(max(begun + allowed, bench.now))
    given = {axis: bench.travels[axis].count(bench.now) for axis in axes}
    assert not any(bench.travels[axis].moving for axis in axes), f"{stop.name} at {begun}: it moves {allowed} ns later"
    bench.go_to(bench.now + LINGER)
    later = {axis: bench.travels[axis].count(bench.now) for axis in axes}
    assert later == given, f"what was pending before {stop.name} at {begun} moved afterwards"
    return True
