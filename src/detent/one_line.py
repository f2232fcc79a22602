"""An error is one line that a person can take in, whatever it quotes of what somebody gave."""

from typing import Final

MOST: Final = 600  # characters
_END: Final = 250  # of them that stay of the end, where the remedy is


def one_line(text: str, most: int = MOST) -> str:
    """The text without its middle where it is longer than a line can be, and without what a terminal would obey."""
    if len(text) > most:
        end = min(_END, most // 2)
        text = f"{text[: most - end - 5]} ... {text[-end:]}"
    return text if text.isprintable() else "".join(c if c.isprintable() else "?" for c in text)
