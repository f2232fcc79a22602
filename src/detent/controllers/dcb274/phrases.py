"""Lines of the DCB-274 in words (pages 15 to 28, 33 and 34)."""

import re
from typing import Final

from detent.controllers.dcb274 import commands
from detent.controllers.dcb274.commands import INTERRUPTS, LETTERS, ROWS, Op, Refusal
from detent.controllers.dcb274.link import CR, CTRL_C, CTRL_N, CTRL_P, ESC, LF, SPACE
from detent.controllers.dcb274.ports import JOGS, PORTS, READ_PORTS, SWITCHES
from detent.controllers.phrase import Phrase, Piece, named_bits

_SINGLE: Final = {ESC: "ESC", CTRL_C: "^C", CTRL_N: "^N", CTRL_P: "^P", ord("@"): "@"}
_WORDS: Final = {help_.command: help_.what for help_ in INTERRUPTS}
_STATES: Final = re.compile(r"(\d) ([\w ]+)")  # "0 at rest", as the table has them
_SETTINGS: Final = re.compile(r"(\w)= *([^,\s]+)")
REFUSED: Final = "refused: not understood, or not possible now"


class Phrases:
    """Lines in single mode (to CR), and in party line and daisy chain (name first, to LF)."""

    def whole(self, data: bytes, to_unit: bool) -> bool:
        """At CR or LF towards the unit, and at a character that acts at once; at LF from it, or behind a refusal."""
        if to_unit:
            return data[-1] in (CR, LF) or (len(data) == 1 and data[0] in (*_SINGLE, SPACE))
        return data[-1] == LF

    def read(self, data: bytes, to_unit: bool, asked: bytes = b"") -> Phrase:
        """What a host typed, or what came back."""
        body = data.rstrip(b"\r\n")
        end = (Piece(len(data) - len(body), "end", "end of the line"),) if len(data) > len(body) else ()
        found = self._typed(body, data[-1] == LF) if to_unit else self._said(body, asked)
        return found._replace(pieces=(*found.pieces, *end))

    def _typed(self, body: bytes, named: bool) -> Phrase:
        if not body:
            return Phrase((), "an empty line")
        if len(body) == 1 and body[0] in _SINGLE:
            what = _WORDS[_SINGLE[body[0]]]
            return Phrase((Piece(1, "command", what),), what)
        pieces: tuple[Piece, ...] = ()
        text = body.decode("latin-1")
        if named:
            pieces, text = (Piece(1, "address", f"to the axis {text[0]}"),), text[1:]
        elif text[0] == " ":
            pieces, text = (Piece(1, "command", "sign on"),), text[1:]
        if not text.strip():
            return Phrase((*pieces, *((Piece(len(text), "unknown", "blank"),) if text else ())), "sign on")
        try:
            instruction = commands.parse(text)
        except Refusal as refusal:
            return Phrase((*pieces, Piece(len(text), "error", str(refusal))), f"#: {refusal}", True)
        row = ROWS[instruction.op]
        blank = len(text) - len(text.lstrip(" "))
        made = [Piece(blank, "unknown", "blank"), Piece(1, "command", f"{row.letter}: {row.help}"),
                Piece(len(text) - blank - 1, "argument", row.words)]  # fmt: skip
        return Phrase((*pieces, *(piece for piece in made if piece.length)), row.help)

    def _said(self, body: bytes, asked: bytes) -> Phrase:
        text = body.decode("latin-1")
        if not text:
            return Phrase((), "the next line")
        if text.rstrip().endswith("#"):
            at = text.rindex("#")
            pieces = Piece(at, "echo", "echo"), Piece(len(text) - at, "error", REFUSED)
            return Phrase(tuple(piece for piece in pieces if piece.length), REFUSED, True)
        question = asked.rstrip(b"\r\n").decode("latin-1")
        if not question or not text.startswith(question):
            return Phrase((Piece(len(text), "answer", "what it printed"),), text.strip())
        answer = text[len(question) :]
        note = meaning_of(question[asked[-1:] == bytes((LF,)) :].lstrip(), answer.strip())
        pieces = Piece(len(question), "echo", "echo of what was typed"), Piece(len(answer), "answer", note)
        return Phrase(tuple(piece for piece in pieces if piece.length), note)


def meaning_of(question: str, answer: str) -> str:
    """What `answer` says to the line `question`, in words."""
    if not answer:
        return "done"
    try:
        asked = commands.parse(question)
    except Refusal:
        return answer
    row, value = ROWS[asked.op], int(answer) if answer.isdigit() else None
    reads = asked.values[:1]
    match asked.op:
        case Op.POSITION:
            return f"position {answer}"
        case Op.MOVING if value is not None:
            return f"{answer}: {dict(_STATES.findall(row.help)).get(answer, 'no status that the manual has')}"
        case Op.PORT if value is not None and reads == (READ_PORTS,):
            return f"active ports: {named_bits(value, PORTS[:4])}"
        case Op.READ_INPUTS if value is not None:
            return f"active: {named_bits(value, JOGS if reads == (1,) else (*SWITCHES, *PORTS))}"
        case Op.EXAMINE if "=" in answer:
            return ", ".join(_setting(*found) for found in _SETTINGS.findall(answer))
    return f"{row.result.rpartition(': ')[2] or row.help} {answer}"


def _setting(letter: str, value: str) -> str:
    """A value that X prints, by the command that sets it."""
    row = LETTERS.get(letter)
    what = row.help.removeprefix("Set the ").rstrip(".") if row is not None else "name" if letter == "n" else letter
    return f"{what[:1].lower()}{what[1:]} {value}"
