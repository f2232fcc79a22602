"""What a board says of itself: its commands, responses, pins and constants, and messages by their names.

The firmware sends its dictionary compressed (zlib, JSON). Numbers of messages are its own choice and may be negative;
nothing here knows any but the two that ask for the dictionary.
"""

import json
import re
import zlib
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from typing import Any, NamedTuple, TypeAlias

from detent.one_line import one_line
from detent.realtime.boards.frames import FrameError, integer, read_integer

Value: TypeAlias = int | bytes

_FIELD = re.compile(r"(\w+)=%(\S+)")
_RESERVED = "RESERVE_PINS_"
_NUMBERS = ("CLOCK_FREQ", "RECEIVE_WINDOW")  # constants that are counted with
LARGEST = 4 << 20  # bytes of a dictionary that is unpacked
MOST_NAMES = 100_000  # in its enumerations


class Message(NamedTuple):
    """A message and its fields by their names."""

    name: str
    values: Mapping[str, Value]

    def number(self, field: str) -> int:
        """A field that is an integer."""
        value = self.values[field]
        assert isinstance(value, int)
        return value

    def data(self, field: str) -> bytes:
        """A field that is a string of bytes."""
        value = self.values[field]
        assert isinstance(value, bytes)
        return value


class Format:
    """How one message is written: `queue_step oid=%c interval=%u count=%hu add=%hi`."""

    __slots__ = ("fields", "name", "number", "prefix")

    def __init__(self, text: str, number: int) -> None:
        self.name = text.split(None, 1)[0]
        self.number = number
        self.prefix = integer(number)
        self.fields = tuple((name, kind.endswith("s")) for name, kind in _FIELD.findall(text))  # (name, bytes?)

    def encode(self, values: Mapping[str, Value]) -> bytes:
        """The message. KeyError for a field that is missing, TypeError for one of the wrong kind."""
        parts = [self.prefix]
        for name, is_bytes in self.fields:
            value = values[name]
            if isinstance(value, bytes) is not is_bytes:
                raise TypeError(f"{self.name} {name} takes {'bytes' if is_bytes else 'an integer'}, not {value!r}")
            parts.append(bytes((len(value),)) + value if isinstance(value, bytes) else integer(value))
        if len(values) != len(self.fields):
            raise KeyError(
                f"{self.name} has the fields {', '.join(n for n, _ in self.fields)}, not {', '.join(values)}"
            )
        return b"".join(parts)

    def decode(self, data: bytes, at: int) -> tuple[Message, int]:
        """The message whose fields begin at index `at`, and the index behind it. FrameError."""
        values: dict[str, Value] = {}
        for name, is_bytes in self.fields:
            if is_bytes:
                if at >= len(data) or at + 1 + data[at] > len(data):
                    raise FrameError(f"{self.name} ends within {name}")
                values[name] = data[at + 1 : at + 1 + data[at]]
                at += 1 + data[at]
            else:
                values[name], at = read_integer(data, at)
        return Message(self.name, values), at


class Dictionary:
    """The messages, pins and constants of one firmware."""

    def __init__(self, content: Mapping[str, Any]) -> None:
        self.commands = {f.name: f for f in (Format(t, n) for t, n in content.get("commands", {}).items())}
        formats = [Format(t, n) for t, n in content.get("responses", {}).items()]
        self.responses = {f.number: f for f in formats}
        self.response_names = {f.name: f for f in formats}
        self.constants: Mapping[str, Any] = content.get("config", {})
        self.version = str(content.get("version", ""))
        self.app = str(content.get("app", ""))
        self._numbers: dict[str, dict[str, int]] = {}
        for name, entries in content.get("enumerations", {}).items():
            self._numbers[name] = _spread(entries)
        self._reasons = {number: text for text, number in self._numbers.get("static_string_id", {}).items()}

    @classmethod
    def of_bytes(cls, data: bytes) -> "Dictionary":
        """Of what `identify` gave. ValueError if it is no dictionary."""
        try:
            unpacked = zlib.decompressobj().decompress(data, LARGEST)
            content = json.loads(unpacked)
        except (zlib.error, ValueError) as error:
            raise ValueError(one_line(f"this is no dictionary of a firmware: {error}")) from None
        except RecursionError:
            raise ValueError("this is no dictionary of a firmware: it is nested too deeply") from None
        if not isinstance(content, dict) or "commands" not in content:
            raise ValueError("this is no dictionary of a firmware: it names no commands")
        _check(content)
        return cls(content)

    @property
    def frequency(self) -> int:
        """Ticks a second of its clock, nominal."""
        return int(self.constants.get("CLOCK_FREQ", 0))

    @property
    def mcu(self) -> str:
        """The microcontroller, as it calls itself."""
        return str(self.constants.get("MCU", "unknown"))

    @property
    def receive_window(self) -> int | None:
        """Bytes that may be under way to it; None: no limit of its own."""
        value = self.constants.get("RECEIVE_WINDOW")
        return None if value is None else int(value)

    @property
    def pins(self) -> tuple[str, ...]:
        """The names of its pins, in the order of their numbers; of several for one pin, the shortest."""
        names: dict[int, str] = {}
        for name, number in self._numbers.get("pin", {}).items():
            names[number] = min(names.get(number, name), name, key=len)
        return tuple(names[number] for number in sorted(names))

    @property
    def reserved(self) -> dict[str, str]:
        """Pins that it needs itself, and what for."""
        found: dict[str, str] = {}
        for name, value in self.constants.items():
            if name.startswith(_RESERVED):
                found |= {pin.strip(): name[len(_RESERVED) :] for pin in str(value).split(",")}
        return found

    def has_pin(self, name: str) -> bool:
        """Whether there is a pin of that name."""
        return name in self._numbers.get("pin", {})

    def number(self, kind: str, name: str) -> int:
        """The number of a pin, an SPI bus ... by its name. KeyError whose text has the nearest ones."""
        numbers = self._numbers.get(kind, {})
        try:
            return numbers[name]
        except KeyError:
            near = get_close_matches(name, numbers, 3) or sorted(numbers, key=numbers.__getitem__)[:3]
            hint = f"; it has {', '.join(near)} ..." if near else ""
            raise KeyError(f"the board ({self.mcu}) has no {kind.replace('_', ' ')} {name}{hint}") from None

    def reason(self, number: int) -> str:
        """The text of a shutdown's number."""
        return self._reasons.get(number, f"reason {number}")

    def encode(self, name: str, **values: Value) -> bytes:
        """A command. KeyError if the firmware has none of that name, or other fields."""
        return self.commands[name].encode(values)

    def parse(self, payload: bytes) -> list[Message]:
        """The responses in a payload. FrameError for one that is not in the dictionary."""
        found = []
        at = 0
        while at < len(payload):
            number, at = read_integer(payload, at)
            try:
                response = self.responses[number]
            except KeyError:
                raise FrameError(f"there is no response {number}") from None
            message, at = response.decode(payload, at)
            found.append(message)
        return found

    def missing(self, wanted: Mapping[str, Iterable[str]]) -> list[str]:
        """Which of the commands and responses, each with its fields, are not there: what a firmware is too old for."""
        absent = []
        for name, fields in wanted.items():
            form = self.commands.get(name) or self.response_names.get(name)
            if form is None:
                absent.append(name)
            elif {field for field, _ in form.fields} != set(fields):
                absent.append(f"{name} with {', '.join(fields)}")
        return absent


def _check(content: Mapping[str, Any]) -> None:
    """Raise ValueError for what a board has said wrongly of itself."""

    def wrong(what: str) -> ValueError:
        return ValueError(one_line(f"this is no dictionary of a firmware: {what}"))

    for name in ("commands", "responses", "config", "enumerations"):
        if not isinstance(content.get(name, {}), dict):
            raise wrong(f"{name} is no table")
    for name in ("commands", "responses"):
        for text, number in content.get(name, {}).items():
            if not text.strip() or type(number) is not int or not -(2**31) <= number < 2**32:
                raise wrong(f"{name}: {text!r} has the number {number!r}")
    for name in _NUMBERS:
        value = content.get("config", {}).get(name, 0)
        if type(value) not in (int, float) or not 0 <= value < 2**32:
            raise wrong(f"{name} is {value!r}")
    count = 0
    for name, entries in content.get("enumerations", {}).items():
        if not isinstance(entries, dict):
            raise wrong(f"{name} is no table")
        for entry, value in entries.items():
            numbers = value if isinstance(value, list) and len(value) == 2 else [value, 1]
            if any(type(one) is not int or not 0 <= one < 2**32 for one in numbers):
                raise wrong(f"{name} {entry!r} has the numbers {value!r}")
            count += numbers[1]
            figures = entry[len(entry.rstrip("0123456789")) :]
            if count > MOST_NAMES or len(figures) > 9:
                raise wrong(f"{name} {entry!r} and so on are too many names")


def _spread(entries: Mapping[str, Any]) -> dict[str, int]:
    """An enumeration, its ranges [first number, count] told one by one: gpio0: [0, 3] is gpio0, gpio1, gpio2."""
    found: dict[str, int] = {}
    for name, value in entries.items():
        if isinstance(value, int):
            found[name] = value
            continue
        first, count = value
        root = name.rstrip("0123456789")
        begin = int(name[len(root) :] or 0)
        found |= {f"{root}{begin + k}": first + k for k in range(count)}
    return found


BARE = Dictionary(
    {
        "commands": {"identify offset=%u count=%c": 1},
        "responses": {"identify_response offset=%u data=%.*s": 0},
    }
)
