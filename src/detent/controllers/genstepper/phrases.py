"""What is typed to GenStepper, and what it prints, in words (pages 22 to 44)."""

import re
from typing import Final

from detent.controllers.genstepper import commands
from detent.controllers.genstepper.commands import ACTIONS, MEMORY, REPORTS, STEP_ACTION, VERSION
from detent.controllers.genstepper.link import PROMPT
from detent.controllers.phrase import Phrase, Piece, named_bits

_NUMBER: Final = "0123456789+-"
_TOLD: Final = {report.number: report.what for report in REPORTS} | dict(MEMORY) | {VERSION: "version"}

_WEIGHT: Final = re.compile(r"([A-Z]+[-+]?) (\d+)")  # "LY- 1": a bit and its name, as the table of MEMORY has them
_CHOICE: Final = re.compile(r"(\d) (\w+)")  # "0 off": a value and its word, as REPORTS has them


class Phrases:
    """A command is a character with its number before it; an answer ends with the prompt."""

    def whole(self, data: bytes, to_unit: bool) -> bool:
        """At a character that is no part of a number; at the prompt."""
        last = data[-1:].decode("latin-1")
        return last not in _NUMBER if to_unit else last == PROMPT

    def read(self, data: bytes, to_unit: bool, asked: bytes = b"") -> Phrase:
        """A command, or an answer."""
        text = data.decode("latin-1")
        return self._command(text) if to_unit else self._answer(text)

    def _command(self, text: str) -> Phrase:
        if text[-1] in _NUMBER:
            return Phrase((Piece(len(text), "argument", "a number: the VALUE of the command behind it"),), "")
        number, character = text[:-1], text[-1]
        row = commands.row(character)
        value = (Piece(len(number), "argument", row.value if row is not None else "a number"),) if number else ()
        if row is None:
            if character in commands.LITTLE_SAID:
                return Phrase((*value, Piece(1, "end", "between commands: nothing happens")), "")
            what = "no command: ignored, and answered"
            return Phrase((*value, Piece(1, "error", what)), what, True)
        return Phrase((*value, Piece(1, "command", f"{row.character}: {row.help}")), row.help)

    def _answer(self, text: str) -> Phrase:
        body = text.removesuffix(PROMPT)
        prompt = (Piece(1, "end", "the prompt: ready for the next command"),) if len(body) < len(text) else ()
        lines = [line for line in body.replace("\r", "\n").split("\n") if line]
        note = "; ".join(_report(line) for line in lines) or "done"
        return Phrase((*((Piece(len(body), "answer", note),) if body else ()), *prompt), note)


def _report(line: str) -> str:
    """A line of an answer: "X,-1,350" tells the current location of X, "X,0,..." all its reports."""
    name, _, rest = line.partition(",")
    number, comma, values = rest.partition(",")
    try:
        numbers = [report.number for report in REPORTS] if int(number) == 0 else [int(number)]
        found = values.split(",") if len(numbers) > 1 else [values]
        told = ", ".join(_value(*each) for each in zip(numbers, found, strict=True))
    except (ValueError, KeyError):
        return line
    return f"{name}: {told}" if comma else line


def _value(number: int, value: str) -> str:
    """A report, or a memory location, in the words of its table."""
    what = _TOLD[number]
    if number == STEP_ACTION and value.isdigit() and int(value) < len(ACTIONS):
        return f"{what} {value} ({ACTIONS[int(value)]})"
    title, colon, bits = what.partition(":")
    if colon and number in dict(MEMORY) and value.isdigit():
        names = [(int(bit), name) for name, bit in _WEIGHT.findall(bits)]
        return f"{title} {value}" + (f" ({named_bits(int(value), names)})" if names else "")
    words = dict(_CHOICE.findall(bits))
    return f"{title} {value}" + (f" ({words[value]})" if value in words else "")
