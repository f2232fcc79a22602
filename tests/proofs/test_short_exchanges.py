"""Two or three characters, whatever they are, in every state in which a unit listens: they end nothing.

What ended a whole server once was a prompt, a command and two control characters. Streams of the fuzz come by such a
place now and then; here each state is a beginning of its own, and most of what is said in it are control characters.
"""

from collections.abc import Sequence
from random import Random
from typing import Final

import pytest
from tests.controllers.laws.bench import Action, Power, Raw, Say, Wait
from tests.proofs.streams import CONTROL
from tests.proofs.units import BY_NAME, Strict

from detent.ticks import MS

A_FEW, MANY = 20, 400
LISTENS: Final = 60 * MS

PRINTED: Final = b"0159ABCDEFGHIKLMNOPQRSTUVWXYZ+-@^!?*/=<>.,:;#%&$_`[]\\ abehlrtwx~"

DCB274: Final = {
    "ready": (),
    "programming": (Raw(b"P 0\r"), Wait(50 * MS)),
    "programming, a line behind": (Raw(b"P 0\r"), Wait(50 * MS), Raw(b"M 1000\r"), Wait(50 * MS)),
    "in the middle of a line of a program": (Raw(b"P 10\r"), Wait(20 * MS), Raw(b"+ 1")),
    "moving": (Raw(b"M 2000\r"), Wait(100 * MS)),
    "after a refusal": (Raw(b"P 99999\r"), Wait(50 * MS)),
}
GSC200: Final = {
    "ready": (),
    "programming": (Say("P"), Wait(50 * MS)),
    "programming, behind some instructions": (Say("P"), Say("A1"), Say("+100"), Wait(20 * MS)),
    "moving": (Say("+10000"), Wait(20 * MS)),
    "in the middle of a frame": (Raw(b"+1"),),
}
OTHERS: Final = {
    "ready": (),
    "moving": (Raw(b"+1000\r"), Wait(20 * MS)),
    "in the middle of a line": (Raw(b"1"),),
    "behind a control character": (Raw(b"\x02"),),
}
STATES: Final = [
    (name, state)
    for name in BY_NAME
    for state in (DCB274 if name.startswith("dcb") else GSC200 if name.startswith("gs-c") else OTHERS)
]


def begin(name: str, state: str, options: int) -> Strict:
    """A unit in that state, its options drawn by a number."""
    model = BY_NAME[name]
    states: dict[str, Sequence[Action]] = {**OTHERS, **GSC200} if name.startswith("gs-c") else {**OTHERS, **DCB274}
    bench = Strict(model.make(model.options(Random(options))))
    bench.play((Power(True), *model.ready(), Wait(300 * MS)))
    bench.play(states[state] if name.startswith(("dcb", "gs-c")) else OTHERS[state])
    return bench


def pairs() -> list[bytes]:
    """All pairs of control characters."""
    return [bytes((one, other)) for one in CONTROL for other in CONTROL]


def some(draw: Random, count: int) -> list[bytes]:
    """Two or three characters, most of them control characters, with or without an end of the line."""
    made = (bytes(draw.choice(CONTROL if draw.random() < 0.6 else PRINTED) for _ in range(3)) for _ in range(count))
    return [said[draw.randrange(2) :] + draw.choice((b"", b"", b"\r")) for said in made]


def hold(name: str, state: str, options: int, exchanges: Sequence[bytes]) -> None:
    first = begin(name, state, options)
    for said in exchanges:
        bench = first.twin()
        try:
            bench.play((Raw(said), Wait(LISTENS)))
            bench.check()
        except Exception as error:
            raise AssertionError(f"{name}, {state}, options {options}: {said!r}") from error


@pytest.mark.parametrize(("name", "state"), STATES)
def test_no_two_or_three_characters_end_a_unit(name: str, state: str) -> None:
    draw = Random(f"{name} {state}")
    before_nul = [bytes((one, other)) for one in CONTROL for other in (0, draw.choice(CONTROL))]
    hold(name, state, 0, [*before_nul, *some(draw, A_FEW)])


@pytest.mark.slow
@pytest.mark.parametrize("options", range(3))
@pytest.mark.parametrize(("name", "state"), STATES)
def test_no_pair_of_control_characters_and_no_three_of_many_more_end_a_unit(
    name: str, state: str, options: int
) -> None:
    hold(name, state, options, pairs() if options == 0 else some(Random(f"{name} {state} {options}"), MANY))
