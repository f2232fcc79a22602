"""Output for a terminal that has not all the signs we write: those it lacks are written with those it has."""

import codecs
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


def make_safe() -> None:
    """Nothing that is printed from now on fails for its signs."""
    codecs.register_error("detent.plain", spell_out)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure") and stream.errors == "strict":
            stream.reconfigure(errors="detent.plain")
