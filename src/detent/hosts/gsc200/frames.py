"""Frames on the line of a GS-C200, seen from the host (datasheet, "Data Exchange Protocol").

To the module: ``[address] command argument [checksum] CR``. From it: ``code argument [checksum] CR``, without an
address. The checksum is the sum of the characters before it, cut to seven bits and ORed with 10h; a GS-C200 older than
V2.2 does not OR, so that there a checksum can be the very character that ends a frame.
"""

from typing import NamedTuple

CR = 0x0D
LINE_BITS = 11  # a character: start bit, 7 data bits, odd parity, 2 stop bits


class Frames(NamedTuple):
    """How one module wants its frames: its address on a multipoint line, checksums, and whether these are ORed."""

    address: int | None = None
    checksums: bool = True
    ored: bool = True

    def checksum(self, data: bytes) -> int:
        """The checksum character of `data`."""
        total = sum(data) & 0x7F
        return total | 0x10 if self.ored else total

    def frame(self, command: str) -> bytes:
        """`command` as it goes out. ValueError if its checksum would end the frame (V2.1 and older)."""
        data = command.encode("ascii")
        if self.address is not None:
            data = b"%d" % self.address + data
        if self.checksums:
            checksum = self.checksum(data)
            if checksum == CR:
                raise ValueError(
                    f"{command} cannot be sent with a checksum: it would be CR, which ends a frame. "
                    "Take another number, or ground CHS and say checksums=False"
                )
            data += bytes([checksum])
        return data + bytes([CR])

    def end(self, data: bytes) -> int | None:
        """How many bytes the first answer in `data` takes; None while it is not whole."""
        place = data.find(CR)
        if place < 0:
            return None
        if self.checksums and not self.ored and self.checksum(data[:place]) == CR:
            return place + 2 if len(data) > place + 1 else None  # that CR was the checksum
        return place + 1

    def text(self, data: bytes) -> str | None:
        """The answer in a whole frame, without checksum and CR; None if it was damaged on the way."""
        body = data[:-1]
        if self.checksums:
            if len(body) < 2 or self.checksum(body[:-1]) != body[-1]:
                return None
            body = body[:-1]
        return body.decode("ascii") if body and body.isascii() else None
