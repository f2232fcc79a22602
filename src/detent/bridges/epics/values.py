"""What clients put, as it comes over the wire: a value that is not wholly there, or no number, moves nothing."""

import re
from collections.abc import Iterable
from typing import Any, Final, NamedTuple

from caproto import CAStatus, ChannelType

_BYTES: Final = {
    ChannelType.STRING: 40, ChannelType.INT: 2, ChannelType.FLOAT: 4, ChannelType.ENUM: 2, ChannelType.CHAR: 1,
    ChannelType.LONG: 4, ChannelType.DOUBLE: 8,
}  # fmt: skip
"""Of one value, by the types in which clients put. The others are those in which a server tells."""

_NUMBER: Final = re.compile(rb"[ \t]*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?[ \t\r\n]*")
_SHOWN: Final = 40  # characters of a value in an error


class Refused(NamedTuple):
    """Why a put is not carried out, and what a client that waits is answered."""

    why: str
    status: CAStatus


def not_whole(command: Any) -> Refused | None:
    """Why the value of a write request cannot be what the message says, or None."""
    try:
        kind = ChannelType(command.header.data_type)
    except ValueError:
        return Refused(f"there is no type {command.header.data_type} of a value", CAStatus.ECA_BADTYPE)
    if kind in (ChannelType.PUT_ACKS, ChannelType.PUT_ACKT):
        return None
    if kind not in _BYTES:
        return Refused(f"a value is put plain, not as {kind.name}", CAStatus.ECA_BADTYPE)
    count, size = command.data_count, command.payload_size
    # a text alone is as long as it is
    least = (count - 1) * _BYTES[kind] + (1 if kind == ChannelType.STRING else _BYTES[kind])
    if count < 1 or size < least:
        return Refused(f"{count} values of type {kind.name} are not {size} bytes", CAStatus.ECA_BADCOUNT)
    return None


def check_number(values: Iterable[bytes]) -> None:
    """Raise ValueError for a text that is put where a number is wanted, and is none.

    What Python reads as a number beyond that, like `1_000` or other scripts' digits, is a slip of somebody's hand.
    """
    for value in values:
        text = value.partition(b"\0")[0]
        if not _NUMBER.fullmatch(text):
            raise ValueError(f"{text.decode('latin-1')[:_SHOWN]!r} is no number")
