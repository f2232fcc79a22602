"""Two columns of numbers, as spreadsheets write them: commas, semicolons or tabs between, a comment behind #.

Where columns are parted by semicolons or tabs, a comma in a number is that of its decimals.
"""

from math import isfinite

WANTED = "give two numbers; decimal commas need semicolons between the columns"


def lines(text: str) -> list[tuple[int, str]]:
    """Lines that say something, each with its number, without comments; a byte order mark is left out."""
    found = ((k, line.partition("#")[0].strip()) for k, line in enumerate(text.lstrip("\ufeff").splitlines(), 1))
    return [(k, line) for k, line in found if line]


def parted(line: str) -> list[str]:
    """The columns of a line, without blanks and quotes."""
    mark = next((mark for mark in (";", "\t") if mark in line), ",")
    return [part.strip().strip('"').strip() for part in line.split(mark)]


def numbers(line: str) -> tuple[float, float]:
    """The two numbers of a line. ValueError for anything else, and for what is not finite."""
    parts = parted(line)
    if ";" in line or "\t" in line:
        parts = [part.replace(",", ".") if part.count(",") == 1 and "." not in part else part for part in parts]
    first, second = (float(part) for part in parts)
    if not (isfinite(first) and isfinite(second)):
        raise ValueError(line)
    return first, second
