"""Frames on the serial line (datasheet, "Data exchange protocol").

Host to module: ``[address] command argument [checksum] CR``; module to host: ``code argument [checksum] CR``.
The checksum is the sum of the characters before it, cut to seven bits and, from revision 2.2 on, ORed with
10h so that it can be neither CR nor LF.
"""

from typing import NamedTuple

from detent.uart import Char

CR, LF = 0x0D, 0x0A
LONGEST = 12  # characters before CR


class Frame(NamedTuple):
    """One frame from the host: its command text, or what is wrong with the line it came over (error 1)."""

    text: str
    fault: str = ""


class Link:
    """Collects characters into frames for one module and dresses its answers."""

    __slots__ = ("_characters", "_damaged", "address", "checksums", "ored")

    def __init__(self, address: int | None, checksums: bool, ored: bool) -> None:
        self.address, self.checksums, self.ored = address, checksums, ored
        self._characters = bytearray()
        self._damaged = ""

    def checksum(self, data: bytes) -> int:
        """The checksum character of `data`."""
        total = sum(data) & 0x7F
        return total | 0x10 if self.ored else total

    def frame(self, text: str, *, to_module: bool = False) -> bytes:
        """`text` as it goes over the line: with the address (towards a module), the checksum and CR."""
        data = text.encode("ascii", "replace")
        if to_module and self.address is not None:
            data = b"%d" % self.address + data
        if self.checksums:
            data += bytes([self.checksum(data)])
        return data + b"\r"

    def unframe(self, data: bytes) -> list[str]:
        """The answers in what a module sent, without checksums and CR. A wrong checksum stays, and shows."""
        answers = []
        for line in data.split(b"\r"):
            sound = self.checksums and line and self.checksum(line[:-1]) == line[-1]
            answers.append((line[:-1] if sound else line).decode("latin-1"))
        return [answer for answer in answers if answer]

    def feed(self, char: Char) -> Frame | None:
        """Take one character; return the frame it completes, if that is for this module.

        A damaged character (parity, framing) is never trusted to be a CR. An empty line is no frame, and LF
        is skipped where it cannot be a checksum.
        """
        value = char.value
        if not (char.parity_ok and char.framing_ok):
            self._damaged = "parity error"
            value |= 0x80  # stands for no character, so that it can be neither address nor CR
        elif value == CR:
            return self._complete()
        elif value == LF and not self.checksums:
            return None
        if len(self._characters) <= LONGEST:  # one more than allowed is enough to know
            self._characters.append(value)
        return None

    def _complete(self) -> Frame | None:
        data, damaged = bytes(self._characters), self._damaged
        self._characters.clear()
        self._damaged = ""
        if not data:
            return None
        body = data
        if self.address is not None:
            if data[0] != ord("0") + self.address:
                return None
            body = data[1:]
        fault = damaged
        if not fault and len(data) > LONGEST:
            fault = f"longer than {LONGEST} characters"
        if self.checksums and not fault:
            if not body or self.checksum(data[:-1]) != data[-1]:
                fault = "checksum error"
            else:
                body = body[:-1]
        return Frame(body.decode("latin-1"), fault)
