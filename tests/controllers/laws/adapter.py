"""What the laws must know of a model: the adapter by which a controller joins them.

An adapter is written from the manual. It says how a move is begun in each of the model's ways, what else may happen
meanwhile, which stops there are and how long the manual lets each of them take, where limits are, and how a position is
redefined. It says nothing about how the controller does any of that.
"""

from collections.abc import Callable, Mapping, Sequence
from random import Random
from typing import Any, NamedTuple, Protocol

from tests.controllers.laws.bench import Action, Bench, Contact, Power, Store, Wait
from tests.controllers.laws.histories import History, gap
from tests.controllers.laws.motors import motor

from detent.controllers.device import Controller
from detent.ticks import Ns


class Stop(NamedTuple):
    """One way to stop, and the page of the manual that has it.

    `actions` are what is done. `applies` says whether it can be used now (only a key that is held can be let go),
    `allowed` how long the manual lets it take from now on; both are asked before. `axes`: which ones it stops.
    `holding`: keys stay held until then; for all others they are let go before.
    """

    name: str
    page: str
    actions: Callable[[Bench], Sequence[Action]]
    allowed: Callable[[Bench], Ns]
    applies: Callable[[Bench], bool] = lambda bench: True
    axes: Callable[[Bench], Sequence[str]] = lambda bench: tuple(bench.travels)
    holding: bool = False


class Limit(NamedTuple):
    """Something that stops `axis` in `direction` (0: in both) while it is closed.

    `steps`: how many more the manual's own ramp-down has from a rate; asked whenever something happens, as what a host
    changes meanwhile (a slope) counts. `barred`: no motion begins towards it while it is closed. `met`: whether what is
    under way now heeds it (a home switch only where home is looked for). `gate`: what it stopped goes on when it opens.
    """

    name: str
    axis: str
    direction: int
    closed: Callable[[Bench], bool]
    steps: Callable[[Bench, float], int]
    barred: bool = True
    met: Callable[[Bench], bool] = lambda bench: True
    gate: bool = False


class Redefinition(NamedTuple):
    """A way to give a position another number, and the page that has it.

    `neutral` does the same but for that (= stops like Z; a command that takes the time of O). `applies`: whether it is
    obeyed now.
    """

    name: str
    page: str
    actions: Sequence[Action]
    neutral: Sequence[Action]
    value: int
    axes: Sequence[str]
    applies: Callable[[Bench], bool] = lambda bench: True


class Model(Protocol):
    """The adapter of one model. See CONTRIBUTING, "The laws"."""

    name: str
    axes: Sequence[str]
    """Its axes."""

    phases: Sequence[str]
    """The phases of a motion, as `phase` names them."""

    def options(self, draw: Random) -> Mapping[str, Any]:
        """A way in which it is built."""

    def make(self, options: Mapping[str, Any]) -> Controller:
        """A new one."""

    def ready(self) -> Sequence[Action]:
        """What it takes after its supply is switched on."""

    def contacts(self, draw: Random) -> tuple[Contact, ...]:
        """Switches on its axes, momentary ones too."""

    def actions(self, draw: Random) -> Sequence[Action]:
        """What may happen: moves in each of its ways, settings, questions, keys, momentary contacts, noise, power."""

    def meanwhile(self, draw: Random) -> Sequence[Action]:
        """What may happen behind a stop without beginning a move, or changing a ramp."""

    def phase(self, bench: Bench, axis: str) -> str:
        """The phase in which an axis is."""

    def let_go(self, bench: Bench) -> Sequence[Action]:
        """Let go whatever the manual lets set a motion off again by itself: keys that are held."""

    def stops(self) -> Sequence[Stop]:
        """Every stop that the manual names."""

    def meets(self, phase: str, stop: Stop) -> bool:
        """Whether a stop can come in a phase."""

    def limits(self) -> Sequence[Limit]:
        """Its limits."""

    modulus: int
    """The positions that its counter can tell apart."""

    def redefinition(self, draw: Random) -> Redefinition | None:
        """A way in which it redefines a position; None if it has none."""

    def redefines(self, bench: Bench) -> bool:
        """Whether the last action, or what it set off, may give the position another number."""

    def onward(self, draw: Random) -> Sequence[Action]:
        """What does not depend on the number that a position has: relative moves, slews, stops, keys."""

    def told(self, bench: Bench, axis: str) -> int | None:
        """The position as it tells its host now, asked over the line; None if it cannot be asked now."""


WITH_MOTOR = 0.04
"""How many histories have a motor on the pins: one costs as much as ten without."""


def ready(model: Model, history: History) -> Bench:
    """A bench with a device that has been switched on and is ready."""
    axis, driven = history.motor, None
    moved = [contact for contact in history.contacts if contact.axis == axis]
    if axis is not None:
        driven = motor(model.name, axis, moved)
    contacts = [contact for contact in history.contacts if contact.axis != axis]
    bench = Bench(model.make(history.options), contacts, driven, moved)
    bench.play((Power(True), *model.ready()))
    return bench


def history(model: Model, draw: Random, most: int = 12) -> History:
    """A history of a model."""
    actions: list[Action] = []
    for _ in range(draw.randint(1, most)):
        actions += (*model.actions(draw), Wait(gap(draw)))
    if draw.random() < 0.05:
        place = draw.randrange(len(actions))
        actions[place:place] = [Store(False), *([Wait(gap(draw)), Store(True)] if draw.random() < 0.5 else [])]
    made = History(model.options(draw), model.contacts(draw), tuple(actions))
    if draw.random() >= WITH_MOTOR:
        return made
    return made._replace(motor=draw.choice(model.axes))
