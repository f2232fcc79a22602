"""The commands of a model by what is typed of them: for colours, completion and help in an editor."""

from collections.abc import Sequence
from typing import NamedTuple

from detent.controllers import catalogue
from detent.controllers.device import CommandHelp
from detent.controllers.gsc200 import commands as gsc200


class Word(NamedTuple):
    """Letters, a sign or a word with which commands begin, and the rows of the table that begin so."""

    spelling: str
    rows: tuple[CommandHelp, ...]
    whole: bool  # a word of its own, with a space behind it: "move", not "W"


def check_typed(text: str) -> str:
    """`text`, if a command line can be it: printable ASCII. Raises ValueError."""
    foreign = next((one for one in text if not " " <= one <= "~"), None)
    if foreign is not None:
        raise ValueError(f"{foreign!r} is on no line of these units: write printable ASCII")
    return text


def words(model: str) -> tuple[Word, ...]:
    """The words of `model`, the longest first, as the longest that fits counts. Raises CatalogueError."""
    found: dict[str, list[CommandHelp]] = {}
    for row, spellings in zip(catalogue.model(model).commands(), _spellings(model), strict=True):
        for spelling in spellings:
            found.setdefault(spelling, []).append(row)
    ordered = sorted(found.items(), key=lambda item: -len(item[0]))
    return tuple(Word(spelling, tuple(rows), len(spelling) > 2) for spelling, rows in ordered)


def _spellings(model: str) -> list[Sequence[str]]:
    """What is typed of each row of the model's table, in its order."""
    rows = catalogue.model(model).commands()
    if model in gsc200.MODELS:
        return [row.spellings for row in gsc200.rows(model)]
    typed: list[Sequence[str]] = []
    for row in rows:
        first = row.command.split()[0]
        if first in ("0-9", "+") and row.type == "number":  # no commands, but parts of their VALUE
            typed.append(())
        elif len(first) > 2 or (first.startswith("^") and len(first) == 2):
            typed.append((first,))
        elif row.type in ("board", "motors", "choice"):  # GenStepper takes either case
            typed.append(tuple(dict.fromkeys((first, first.lower()))))
        else:
            typed.append((first,))
    return typed
