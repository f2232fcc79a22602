"""Frames of the GS-C200 in words (datasheet, "Data exchange protocol" and the error table)."""

from collections.abc import Mapping
from typing import Final

from detent.controllers.gsc200 import commands, pins
from detent.controllers.gsc200.commands import CommandError, Instruction, Op
from detent.controllers.gsc200.link import CR, LONGEST, Link
from detent.controllers.phrase import Phrase, Piece
from detent.pins import HIGH, Level

ERRORS: Final = {
    "1": "parity error, wrong checksum, or more than 12 characters before CR",
    "2": "argument missing, not wanted, not a number, or out of range",
    "3": "program memory full",
    "4": "unknown command, one of the other model, or not allowed now",
    "5": "position counter overflow",
    "6": "EEPROM not written",
}
ANSWERS: Final = {"Y": "done, or begun", "B": "busy: not now", "R": "ready"}


def verified(text: str, what: int) -> str:
    """What stands behind V: the position, or user inputs and outputs with the weights 1, 2, 4, as V1 or V2 asked."""
    if what == 1:
        return f"position {text}"
    if what == 2 and len(text) == 2 and text.isdigit():
        levels = ((kind, int(figure)) for kind, figure in zip(("UI", "UO"), text, strict=True))
        return ", ".join(f"{kind}{n + 1}={value >> n & 1}" for kind, value in levels for n in range(3))
    return f"{text}: a position, or inputs and outputs"


class Phrases:
    """The frames of one model, on a line as the straps have it."""

    def __init__(self, model: str, straps: Mapping[str, Level]) -> None:
        self._model = model
        straps = {**pins.DEFAULT_STRAPS, **straps}
        self._addressed, self._checksums = pins.address(straps) is not None, straps["CHS"] == HIGH

    def whole(self, data: bytes, to_unit: bool) -> bool:
        """At CR."""
        return data[-1] == CR

    def read(self, data: bytes, to_unit: bool, asked: bytes = b"") -> Phrase:
        """The frame of a host, or the answer of a module."""
        body, end = (data[:-1], [Piece(1, "end", "CR: end of the frame")]) if data[-1] == CR else (data, [])
        pieces: list[Piece] = []
        fault = f"longer than {LONGEST} characters: E1" if len(body) > LONGEST else ""
        text = body
        if to_unit and self._addressed and text:
            number, text = text[:1], text[1:]
            pieces.append(Piece(1, "address", f"to the module {number.decode('latin-1')}"))
        check: list[Piece] = []
        if self._checksums and text and end:
            check, text = [Piece(1, "checksum", f"checksum {body[-1]:02X}h")], text[:-1]
            wanted = [Link(None, True, ored).checksum(body[:-1]) for ored in (True, False)]
            if body[-1] not in wanted:
                fault = fault or f"wrong checksum, {body[-1]:02X}h instead of {wanted[0]:02X}h: E1"
                check = [Piece(1, "error", fault)]
        said = text.decode("latin-1")
        found = self._command(said) if to_unit else self._answer(said, self._asked(asked))
        note = fault or found.note
        return Phrase((*pieces, *found.pieces, *check, *end), note, bool(fault) or found.wrong)

    def _asked(self, frame: bytes) -> Instruction | None:
        """The instruction in the frame of a host; None if there is none."""
        text = frame[1 if self._addressed else 0 : -2 if self._checksums else -1]
        try:
            return commands.parse(self._model, text.decode("latin-1"))
        except CommandError:
            return None

    def _command(self, text: str) -> Phrase:
        if not text:
            return Phrase((), "an empty line: no frame")
        try:
            instruction = commands.parse(self._model, text)
        except CommandError as error:
            return Phrase((Piece(len(text), "error", error.reason),), f"E{error.code}: {error.reason}", True)
        row = commands.row(self._model, instruction.op)
        letters = max((s for s in row.spellings if text.startswith(s)), key=len, default="")
        pieces = [Piece(len(letters), "command", f"{letters}: {row.help}")]
        if text[len(letters) :]:
            pieces.append(Piece(len(text) - len(letters), "argument", row.argument.words))
        return Phrase(tuple(piece for piece in pieces if piece.length), row.help)

    def _answer(self, text: str, asked: Instruction | None) -> Phrase:
        if text in ANSWERS:
            return Phrase((Piece(1, "answer", ANSWERS[text]),), ANSWERS[text])
        if text[:1] == "E" and text[1:] in ERRORS:
            what = ERRORS[text[1:]]
            return Phrase((Piece(2, "error", f"error {text[1:]}: {what}"),), f"{text}: {what}", True)
        if text[:1] == "V" and text[1:]:
            meaning = verified(text[1:], asked.value if asked is not None and asked.op is Op.VERIFY else 0)
            return Phrase((Piece(1, "answer", "verified"), Piece(len(text) - 1, "argument", meaning)), meaning)
        if text == "END":
            return Phrase((Piece(3, "answer", "end of the program"),), "end of the program")
        what = "an instruction of the program" if text else ""
        return Phrase((Piece(len(text), "answer", what),) if text else (), what)
