"""Intel HEX: an image as the records that EPROM programmers read."""

BYTES = 16  # of data in a record


def intel_hex(image: bytes, address: int) -> str:
    """The records of `image` from `address` on, and the end record. ValueError beyond 16 bits of address."""
    if not 0 <= address <= address + len(image) <= 0x10000:
        raise ValueError(f"an image of {len(image)} bytes at {address:04X}h does not fit 16 bits of address")
    records = [_record(address + at, 0, image[at : at + BYTES]) for at in range(0, len(image), BYTES)]
    return "".join(line + "\n" for line in [*records, _record(0, 1, b"")])


def _record(address: int, kind: int, data: bytes) -> str:
    body = bytes([len(data), address >> 8, address & 0xFF, kind]) + data
    return ":" + (body + bytes([-sum(body) & 0xFF])).hex().upper()
