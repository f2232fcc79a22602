"""Standard streams that are not what one expects: a terminal without all our signs, or without columns, or none at all.

Signs that a terminal lacks are written with those it has.
"""

import codecs
import os
import sys

SIGNS = {
    "\N{PLUS-MINUS SIGN}": "+-", "\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u",
    "\N{MULTIPLICATION SIGN}": "x",
    "\N{DEGREE SIGN}": " deg", "\N{RIGHTWARDS ARROW}": "->", "\N{LEFTWARDS ARROW}": "<-", "\N{EN DASH}": "-",
    "\N{EM DASH}": "-", "\N{MINUS SIGN}": "-", "\N{HORIZONTAL ELLIPSIS}": "...", "\N{MIDDLE DOT}": ".",
    "\N{LESS-THAN OR EQUAL TO}": "<=", "\N{GREATER-THAN OR EQUAL TO}": ">=", "\N{SUPERSCRIPT TWO}": "2",
    "\N{GREEK CAPITAL LETTER OMEGA}": "ohm", "\N{OHM SIGN}": "ohm", "\N{BULLET}": "*",
}  # fmt: skip


def spell_out(error: UnicodeError) -> tuple[str, int]:
    """The signs that cannot be encoded, in others; ``?`` for one that has none."""
    assert isinstance(error, UnicodeEncodeError)
    return "".join(SIGNS.get(sign, "?") for sign in error.object[error.start : error.end]), error.end


def open_closed() -> None:
    """Standard streams that are closed (`>&-`) lead to nowhere from now on, and no file takes their place."""
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        if getattr(sys, name) is not None:
            continue
        nowhere = os.open(os.devnull, os.O_RDWR)  # the least number that is free
        if nowhere > number and not _is_open(number):
            os.dup2(nowhere, number)
        setattr(sys, name, os.fdopen(nowhere, mode, encoding="utf-8", closefd=False))


def _is_open(number: int) -> bool:
    try:
        os.fstat(number)
    except OSError:
        return False
    return True


def find_columns() -> None:
    """A terminal that is said to have no columns says nothing: help for no columns would be written for ever."""
    if os.environ.get("COLUMNS", "").strip().strip("0") == "":
        os.environ.pop("COLUMNS", None)


def make_safe() -> None:
    """Nothing that is printed from now on fails for its signs."""
    codecs.register_error("detent.plain", spell_out)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure") and stream.errors == "strict":
            stream.reconfigure(errors="detent.plain")
