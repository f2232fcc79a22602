"""What is typed to GenStepper, and what it prints, in words (pages 22 to 44)."""

from typing import Final

from detent.controllers.genstepper import commands
from detent.controllers.genstepper.commands import MEMORY, REPORTS, VERSION
from detent.controllers.genstepper.link import PROMPT
from detent.controllers.phrase import Phrase, Piece

_NUMBER: Final = "0123456789+-"
_TOLD: Final = {report.number: report.what for report in REPORTS} | dict(MEMORY) | {VERSION: "version"}


class Phrases:
    """A command is a character with its number before it; an answer ends with the prompt."""

    def whole(self, data: bytes, to_unit: bool) -> bool:
        """At a character that is no part of a number; at the prompt."""
        last = data[-1:].decode("latin-1")
        return last not in _NUMBER if to_unit else last == PROMPT

    def read(self, data: bytes, to_unit: bool) -> Phrase:
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
    """A line of an answer: "X,-1,350" tells the current location of X."""
    name, _, rest = line.partition(",")
    number, comma, value = rest.partition(",")
    try:
        what = _TOLD[int(number)]
    except (ValueError, KeyError):
        return line
    return f"{name}: {what} {value}" if comma else line
