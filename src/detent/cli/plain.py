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


def spell_out(error: UnicodeError) -> tuple[str | bytes, int]:
    """The signs that cannot be encoded, in others; ``?`` for one that has none."""
    assert isinstance(error, UnicodeEncodeError)
    return "".join(SIGNS.get(sign, "?") for sign in error.object[error.start : error.end]), error.end


def spell_out_but_bytes(error: UnicodeError) -> tuple[str | bytes, int]:
    """The same, but for a byte of a name that was no text: that is written as it was."""
    assert isinstance(error, UnicodeEncodeError)
    sign = ord(error.object[error.start])
    if 0xDC80 <= sign <= 0xDCFF:
        return bytes([sign - 0xDC00]), error.start + 1
    return SIGNS.get(chr(sign), "?"), error.start + 1


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
    codecs.register_error("detent.plain.bytes", spell_out_but_bytes)
    instead = {"strict": "detent.plain", "surrogateescape": "detent.plain.bytes"}  # the latter with LC_ALL=C
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure") and stream.errors in instead:
            stream.reconfigure(errors=instead[stream.errors])
