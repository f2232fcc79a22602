"""What a program of a GS-C200 or GS-C200S may hold (datasheet, "Command and Functions" and the command descriptions).

A driver reads it before it sends a program: a line that the module obeys at once instead of storing it, such as E,
must not be sent by mistake.
"""

import re
from collections.abc import Iterable
from typing import Final, NamedTuple

GS_C200, GS_C200S = MODELS = ("gs-c200", "gs-c200s")
MEMORY = 119  # bytes ("Program storage capability")

PINS = range(1, 4)  # user inputs and user outputs
TENTHS = range(1, 256)  # of a second, in a delay
RATES = range(1, 1001)  # tens of steps/s
RAMPS = range(1, 1000)  # steps
MOVES = range(1, 1_000_000)  # steps of a move by a distance
ROUNDS = range(1, 256)  # of a loop
ADDRESSES = range(MEMORY)
INPUTS = range(8)  # the three user inputs as a number, weights 1, 2, 4
POSITIONS: Final = {GS_C200: range(10_000_000), GS_C200S: range(-(2**23), 2**23)}

OBEYED_AT_ONCE = frozenset("EFHKMPQVXZ")  # command letters that no program holds


class Form(NamedTuple):
    """One kind of instruction: how it is written, what its number may be, and the memory that it takes.

    `pattern` has the groups `head` (kept as it is) and `number`; `signed` numbers are listed with a sign.
    """

    pattern: str
    numbers: range | None
    size: int
    models: tuple[str, ...] = MODELS
    signed: bool = False


FORMS: Final = (
    Form(r"(?P<head>[AC])(?P<number>\d)", PINS, 2),
    Form(r"(?P<head>D)(?P<number>\d{1,3})", TENTHS, 2),
    Form(r"(?P<head>f)(?P<number>[+-]\d{1,7})", POSITIONS[GS_C200S], 4, (GS_C200S,), signed=True),
    Form(r"(?P<head>G)(?P<number>\d{1,7})", POSITIONS[GS_C200], 4, (GS_C200,)),
    Form(r"(?P<head>G)(?P<number>[+-]?\d{1,7})", POSITIONS[GS_C200S], 4, (GS_C200S,), signed=True),
    Form(r"(?P<head>G[+-])", None, 4, (GS_C200,)),
    Form(r"(?P<head>G[+-])(?P<number>\d)", PINS, 4, (GS_C200,)),
    Form(r"(?P<head>g[+-])", None, 4, (GS_C200S,)),
    Form(r"(?P<head>g[+-])(?P<number>\d)", PINS, 4, (GS_C200S,)),
    Form(r"(?P<head>I)(?P<number>\d)", PINS, 2, (GS_C200S,)),
    Form(r"(?P<head>[jJ])(?P<number>\d{1,3})", ADDRESSES, 2, (GS_C200S,)),
    Form(r"(?P<head>[jJ]c[0-7],)(?P<number>\d{1,3})", ADDRESSES, 2, (GS_C200S,)),
    Form(r"(?P<head>L)(?P<number>[0o])", range(1), 2),
    Form(r"(?P<head>L)(?P<number>\d{1,3})", ROUNDS, 2),
    Form(r"(?P<head>R)(?P<number>\d{1,3})", RAMPS, 4),
    Form(r"(?P<head>[ST])(?P<number>\d{1,4})", RATES, 4),
    Form(r"(?P<head>[UW])(?P<number>\d)", PINS, 2),
    Form(r"(?P<head>[+-])(?P<number>\d{1,6})", MOVES, 4),
)


class Line(NamedTuple):
    """An instruction as Q lists it, and the bytes that it takes."""

    text: str
    size: int


def line(model: str, text: str) -> Line:
    """The instruction that `text` is. ValueError with a remedy if `model` would not store it."""
    wrong: Form | None = None
    for form in FORMS:
        found = re.fullmatch(form.pattern, text.strip(), re.ASCII) if model in form.models else None
        if found is None:
            continue
        if form.numbers is None:
            return Line(found["head"], form.size)
        number = int(found["number"].replace("o", "0"))
        if number in form.numbers:
            head = found["head"].replace("J", "j")
            return Line(head + (f"{number:+d}" if form.signed else f"{number}"), form.size)
        wrong = form
    shown = repr(text)
    if wrong is not None and wrong.numbers is not None:
        raise ValueError(f"{shown}: the number must be {wrong.numbers[0]} to {wrong.numbers[-1]}")
    if text[:1] in OBEYED_AT_ONCE and len(text) <= 2:
        raise ValueError(f"{shown} is obeyed at once and cannot stand in a program: leave it out")
    meant = next(
        (other for other in (text.swapcase(), "+" + text, text.replace(" ", "")) if _is_line(model, other)), ""
    )
    raise ValueError(
        f"{shown} is no instruction of the {model.upper()}" + (f"; did you mean {meant!r}?" if meant else "")
    )


def program(model: str, lines: Iterable[str]) -> list[str]:
    """The lines of a program as Q lists them. ValueError names the line that is wrong, or says it is too long."""
    found = []
    for number, text in enumerate(lines, 1):
        try:
            found.append(line(model, text))
        except ValueError as error:
            raise ValueError(f"line {number}: {error}") from None
    size = sum(one.size for one in found)
    if size > MEMORY:
        raise ValueError(f"the program takes {size} bytes, the memory has {MEMORY}: leave out {size - MEMORY}")
    return [one.text for one in found]


def _is_line(model: str, text: str) -> bool:
    return any(model in form.models and re.fullmatch(form.pattern, text, re.ASCII) for form in FORMS)
