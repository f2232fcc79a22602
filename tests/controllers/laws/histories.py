"""Histories made by number: what may happen to a device before, while and after it does what a law speaks of.

A history is made by `random.Random` from its number, so that it is the same on every machine, and costs a tenth of what
it costs to be played. One that breaks a law is made as small as it can be before it is shown.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from random import Random
from typing import Any, NamedTuple, TypeVar

from tests.controllers.laws.bench import Action, Contact, Wait
from tests.generated import examples

from detent.ticks import MS, Ns

T = TypeVar("T")

ORDINARY, THOROUGH = examples(400), 10_000  # histories of a model that a law is held against
GAPS: Sequence[Ns] = (0, 0, 0, 1, 1 * MS, 2 * MS, 12 * MS, 40 * MS, 90 * MS, 150 * MS, 400 * MS, 700 * MS, 4000 * MS)


class History(NamedTuple):
    """How a device is built, what sits on its axes, what happens to it before and behind what a law speaks of.

    `motor`: an axis that has one, whose rotor moves the contacts there; None: pulses move them all.
    """

    options: Mapping[str, Any]
    contacts: tuple[Contact, ...]
    actions: tuple[Action, ...]
    later: tuple[Action, ...] = ()
    motor: str | None = None

    def smaller(self) -> "Iterator[History]":
        """The same with one thing less, or one wait shorter."""
        for n in reversed(range(len(self.actions))):
            yield self._replace(actions=self.actions[:n] + self.actions[n + 1 :])
        for n in reversed(range(len(self.later))):
            yield self._replace(later=self.later[:n] + self.later[n + 1 :])
        for n in range(len(self.contacts)):
            yield self._replace(contacts=self.contacts[:n] + self.contacts[n + 1 :])
        if self.motor is not None:
            yield self._replace(motor=None)
        for name in self.options:
            yield self._replace(options={key: value for key, value in self.options.items() if key != name})
        for n, action in enumerate(self.actions):
            if isinstance(action, Wait):
                for time in (gap for gap in GAPS if gap < action.time and gap % MS == 0):
                    yield self._replace(actions=(*self.actions[:n], Wait(time), *self.actions[n + 1 :]))


def gap(draw: Random) -> Ns:
    """Time between two actions."""
    return draw.choice(GAPS) if draw.random() < 0.7 else draw.randrange(60 * MS)


def hold(
    law: Callable[[History, T], object], make: Callable[[Random], tuple[History, T]], count: int, name: str
) -> int:
    """Hold a law against so many histories; the number of those that it had something to say about.

    A law returns False for a history in which what it speaks of does not happen. Raises AssertionError with the
    smallest history found that breaks it.
    """
    told = 0
    for number in range(count):
        history, then = make(Random(f"{name} {number}"))
        try:
            told += law(history, then) is not False
        except Exception as error:
            smallest, why = _smallest(law, history, then, error)
            raise AssertionError(f"{why}\nhistory {number} of {name}, made as small as it goes:\n"
                                 f"{shown(smallest)}\nthen {then}") from error  # fmt: skip
    return told


def shown(history: History) -> str:
    """A history as a person reads it, an action a line."""
    lines = [f"  {name} = {value!r}" for name, value in history.options.items()]
    lines += [f"  {contact}" for contact in history.contacts]
    lines += [] if history.motor is None else [f"  a motor on {history.motor or 'the axis'}"]
    later = [f"  {action}" for action in history.later]
    return "\n".join(lines + [f"  {action}" for action in history.actions] + ["later", *later] * bool(later))


def _smallest(
    law: Callable[[History, T], object], history: History, then: T, error: Exception
) -> tuple[History, Exception]:
    """The smallest history found in which the law breaks in the same way."""
    tries, found = 2000, True
    while found:
        found = False
        for smaller in history.smaller():
            tries -= 1
            if tries < 0:
                break
            try:
                law(smaller, then)
            except Exception as other:
                if type(other) is type(error):
                    history, error, found = smaller, other, True
                    break
    return history, error
