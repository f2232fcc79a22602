"""Lines of the DCB-274 in words (pages 15 to 28, 33 and 34)."""

from typing import Final

from detent.controllers.dcb274 import commands
from detent.controllers.dcb274.commands import INTERRUPTS, ROWS, Refusal
from detent.controllers.dcb274.link import CR, CTRL_C, CTRL_N, CTRL_P, ESC, LF, SPACE
from detent.controllers.phrase import Phrase, Piece

_SINGLE: Final = {ESC: "ESC", CTRL_C: "^C", CTRL_N: "^N", CTRL_P: "^P", ord("@"): "@"}
_WORDS: Final = {help_.command: help_.what for help_ in INTERRUPTS}
REFUSED: Final = "refused: not understood, or not possible now"


class Phrases:
    """Lines in single mode (to CR), and in party line and daisy chain (name first, to LF)."""

    def whole(self, data: bytes, to_unit: bool) -> bool:
        """At CR or LF towards the unit, and at a character that acts at once; at LF from it, or behind a refusal."""
        if to_unit:
            return data[-1] in (CR, LF) or (len(data) == 1 and data[0] in (*_SINGLE, SPACE))
        return data[-1] == LF

    def read(self, data: bytes, to_unit: bool) -> Phrase:
        """What a host typed, or what came back."""
        body = data.rstrip(b"\r\n")
        end = (Piece(len(data) - len(body), "end", "end of the line"),) if len(data) > len(body) else ()
        found = self._typed(body, data[-1] == LF) if to_unit else self._said(body)
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

    def _said(self, body: bytes) -> Phrase:
        text = body.decode("latin-1")
        if not text:
            return Phrase((), "the next line")
        if text.rstrip().endswith("#"):
            at = text.rindex("#")
            pieces = Piece(at, "echo", "echo"), Piece(len(text) - at, "error", REFUSED)
            return Phrase(tuple(piece for piece in pieces if piece.length), REFUSED, True)
        return Phrase((Piece(len(text), "answer", "echo of what was typed, and the answer"),), text.strip())
