"""Did you mean: the names that somebody may have meant who wrote one that there is not.

A wrong guess is worse than none where names are of pins: of two ends of an axis, LX+ and LX-, neither is proposed.
Names that are equally near are all named, so that nobody takes the first of them for the one that was meant.
"""

from collections.abc import Iterable
from difflib import SequenceMatcher
from typing import Final

CUTOFF: Final = 0.5  # how much of two names must agree, from 0 to 1
LONGEST: Final = 100  # characters: what is longer was never meant to be a name
_LIKE = 1e-9  # as near as another
_OTHER = {"+": "-", "-": "+"}


def nearest(name: str, known: Iterable[str], cutoff: float = CUTOFF) -> list[str]:
    """The known names that are nearest to one that is not known: another case of it before anything else.

    Several where they are equally near; none where none is near, or where one of them, LX+ or -VSL, is there with the
    other sign as well.
    """
    names = list(dict.fromkeys(known))
    if len(name) > LONGEST:
        return []
    if same := [found for found in names if found.lower() == name.lower()]:
        return same
    found: list[str] = []
    best = cutoff
    matcher = SequenceMatcher(None, "", name)
    for other in names:
        matcher.set_seq1(other)
        if matcher.real_quick_ratio() < best - _LIKE or (like := matcher.ratio()) < best - _LIKE:
            continue
        found, best = ([*found, other], best) if found and like < best + _LIKE else ([other], like)
    return [] if any(_other_sign(end) in names for end in found) else found


def did_you_mean(name: str, known: Iterable[str], cutoff: float = CUTOFF) -> str:
    """The hint in an error, with a blank behind it: ``did you mean UI1 or UI2? ``, or nothing."""
    found = nearest(name, known, cutoff)
    return f"did you mean {' or '.join([', '.join(found[:-1])] * (len(found) > 1) + found[-1:])}? " if found else ""


def _other_sign(name: str) -> str | None:
    if name.endswith(("+", "-")):
        return name[:-1] + _OTHER[name[-1]]
    return _OTHER[name[0]] + name[1:] if name.startswith(("+", "-")) else None
