"""Names of axes on a line that several share (pages 19 and 23)."""

from typing import Final

NOT_NAMES: Final = "[\\]^_`@"  # and ^C, CR, LF (page 23)
ADAPTERS_OWN: Final = ";&*"  # mean something to a SIN-10: no names behind one


def is_name(text: str) -> bool:
    """Whether this is one character that may be the name of an axis (page 23), and can be typed."""
    return len(text) == 1 and "!" <= text <= "~" and text not in NOT_NAMES


def next_name(name: str) -> str:
    """The name behind `name` in ASCII order."""
    names = [chr(value) for value in range(0x21, 0x7F) if is_name(chr(value))]
    return names[(names.index(name) + 1) % len(names)]
