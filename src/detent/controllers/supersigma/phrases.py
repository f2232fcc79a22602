"""Messages on the MICROBUS in words (the paper's table 1)."""

from detent.controllers.phrase import Phrase, Piece
from detent.controllers.supersigma import commands, link


class Phrases:
    """Messages of the CCU, whose length their op-code tells, and answers of three bytes."""

    def whole(self, data: bytes, to_unit: bool) -> bool:
        """By the length."""
        if not to_unit:
            return len(data) == link.ANSWER_LENGTH
        return len(data) >= commands.SHORTEST and len(data) >= commands.length(data[1])

    def read(self, data: bytes, to_unit: bool, asked: bytes = b"") -> Phrase:
        """A message, or an answer."""
        return self._message(data) if to_unit else self._answer(data)

    def _message(self, data: bytes) -> Phrase:
        number = Piece(1, "address", f"to the drive {data[0]}")
        if len(data) < commands.SHORTEST:
            return Phrase((number,), "")
        row = commands.row(data[1])
        if row is None:
            what = f"{data[1]:02X}h is no op-code"
            return Phrase((number, Piece(len(data) - 1, "error", what)), what, True)
        if not self.whole(data, True):
            return Phrase((number, Piece(len(data) - 1, "command", row.help)), "")
        command = commands.parse(data)
        assert command is not None
        backward = ", backward" if command.direction < 0 else ""
        pieces = [number, Piece(1, "command", f"{row.word}{backward}: {row.help}")]
        if row.steps:
            pieces.append(Piece(2, "argument", f"{command.steps} steps"))
        if row.speed:
            pieces.append(Piece(1, "argument", f"{command.speed * commands.SPEED_UNIT} half steps/s"))
        return Phrase(tuple(pieces), commands.spell(command))

    def _answer(self, data: bytes) -> Phrase:
        text = link.answers(data)[0]
        if len(data) < link.ANSWER_LENGTH:
            return Phrase((Piece(len(data), "answer", "steps done"),), "")
        flags = [flag.help for flag in link.FLAGS if data[2] & flag.bit]
        refused = bool(data[2] & link.REFUSED.bit)
        pieces = (Piece(2, "answer", "steps done, modulo 65 536"),
                  Piece(1, "error" if refused else "answer", "; ".join(flags) or "no flag is set"))  # fmt: skip
        return Phrase(pieces, text, refused)
