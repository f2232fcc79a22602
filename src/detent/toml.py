"""TOML as people write it, read in time that grows with the text and no faster, and refused in a line of words.

Python's reader takes time that grows with the square of the parts of a dotted key, and fails in ways of its own for
what is nested too deeply or has too many digits.
"""

import json
import re
import tomllib
from typing import Any, Final

from detent.one_line import one_line

MOST_PARTS: Final = 20  # of a dotted key: no file that is meant here has so many
_LONG_KEY: Final = re.compile(
    r"""(?:^|[{,])[ \t]*+\[{0,2}+[ \t]*+(?:(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+)"""
    rf"{{{MOST_PARTS}}}",
    re.MULTILINE,
)


_LONG_NUMBER: Final = re.compile(r"[0-9](?:_?[0-9]){4000}")


class NoToml(ValueError):
    """A text that is no TOML, or none that is meant here. It says why."""


def loads(text: str) -> dict[str, Any]:
    """The tables of a text. Raises NoToml."""
    if found := _LONG_KEY.search(text):
        line = text.count("\n", 0, found.end()) + 1
        raise NoToml(f"a key of more than {MOST_PARTS} parts (at line {line}): no key that is meant here has so many")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise NoToml(one_line(f"it is no TOML: {error}")) from None
    except RecursionError:
        raise NoToml("its tables and lists are nested too deeply: no key that is meant here is") from None
    except ValueError:  # an integer of more digits than Python reads
        found = _LONG_NUMBER.search(text)
        place = f" (at line {text.count(chr(10), 0, found.start()) + 1})" if found else ""
        raise NoToml(
            f"it has a number of thousands of digits{place}: no number that is meant here is so long"
        ) from None


def written(text: str) -> str:
    """A text as TOML has it, in quotes and on a line. JSON's escapes are TOML's, but for what lies beyond 16 bits."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
