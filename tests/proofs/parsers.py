"""Everything that reads what comes from outside, under what is nearly right: it is read, or refused in a line of words.

Targets read cell files (and build and start the cell), motors, backups, programs and their images, the blocks and the
dictionary of a board, RFC 2217, requests to the control port, the arguments of its verbs, durations and addresses.
"""

import asyncio
import json
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random
from typing import Final, NamedTuple

from tests.controllers.laws.models import MODELS
from tests.proofs.streams import damaged_image
from tests.proofs.tally import Tally

from detent.assembler import AssemblyFailed, ImageError, assemble, disassemble
from detent.cell.build import build
from detent.cell.description import Problem, parse
from detent.controllers import catalogue
from detent.hosts.backups import Backup, BackupError
from detent.motors import own
from detent.motors.motor import MotorError
from detent.realtime import http1, verbs
from detent.realtime.boards import frames
from detent.realtime.boards.dictionary import Dictionary
from detent.realtime.endpoints.comport import ComPort
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.verbs import AskedWrongly
from detent.ticks import MS, parse_duration
from detent.uart import Format

EXAMPLES: Final = Path(__file__).parents[2] / "examples"
LONGEST_ERROR: Final = 1000  # characters
NASTY: Final = (
    "nan", "-inf", "inf", "1e400", "-1", "0", "-0.0", "1e308", "1e-308", "9" * 400, "9" * 5000, "0x" + "f" * 300,
    '""', '"a b"', '"$end"', '"\\u0000"', '"' + "x" * 2000 + '"', "[]", "{}", "[[[]]]", "true", "1979-05-27",
    "[" * 3000, '"../../etc/passwd"', '"nan"', '"1e9 s"', '"-5 ms"', "2147483648", "1.5",
)  # fmt: skip
FORMAT: Final = Format(9600, 7, "odd", 2)


class Target(NamedTuple):
    """Something that reads: what it does with bytes, what it may raise, and what is nearly right for it."""

    read: Callable[[bytes], object]
    raises: tuple[type[Exception], ...]
    seeds: Callable[[], Sequence[bytes]]
    texts: bool = True


def _file(name: str) -> str:
    for path in sorted(EXAMPLES.glob(f"*/{name}")):
        return path.read_text(encoding="utf-8")
    raise FileNotFoundError(2, "No such file or directory")


def _cell(data: bytes) -> None:
    description = parse(data.decode("utf-8", "replace"), "cell.toml")
    if sum(len(unit.model) for unit in description.units.values()) < 200:
        cell = build(description, _file, record=False)
        cell.run_to(5 * MS)


def _cells() -> Sequence[bytes]:
    return [path.read_bytes() for path in sorted(EXAMPLES.glob("*/*.toml")) if b"[motors" not in path.read_bytes()]


MOTOR: Final = b"""name = "my-23"
resistance = 1.1
inductance = 3.6e-3
current = 2.8
torque = 1.26
inertia = 3.0e-5
steps = 200
detent_torque = 0.04
wiring = "parallel"
damping = 0.1
accuracy = 0.05
[curve]
supply = 48
current = 2.8
step = "half"
points = [[100, 1.1], [1000, 0.7], [4000, 0.2]]
"""

BACKUP: Final = b"""format = "detent backup 1"
model = "gs-c200s"
[saved]
program = ["+500", "D1", "j0"]
registers = { S = 10, T = 100 }
"""


def _assembled(model: str) -> Callable[[bytes], object]:
    return lambda data: assemble(catalogue.language(model), data.decode("latin-1"))


def _decoded(model: str) -> Callable[[bytes], object]:
    return lambda data: disassemble(catalogue.language(model), data)


def _restored(number: int) -> Callable[[bytes], object]:
    def read(data: bytes) -> None:
        unit = MODELS[number].make({})
        unit.restore(data)
        unit.power(True, 0)
        unit.drain()

    return read


def _programs() -> Sequence[bytes]:
    return [path.read_bytes() for path in sorted(EXAMPLES.glob("*/*.gsc"))] or [b"a: +1\n"]


def _images(model: str) -> Callable[[], Sequence[bytes]]:
    source = {"dcb-274": "P 0\nM 300\nW 5\nJ 0 3\nP"}.get(model, "W1\n+300\nU1\n-300")
    return lambda: [assemble(catalogue.language(model), source).whole]


def _kept(number: int) -> Callable[[], Sequence[bytes]]:
    return lambda: [MODELS[number].make({}).kept_memory() or b"\0"]


def _blocks(data: bytes) -> None:
    reader = frames.Reader()
    for place in range(0, len(data), 7):
        for block in reader.feed(data[place : place + 7]):
            try:
                DICTIONARY.parse(block.payload)
            except frames.FrameError:
                continue


def _good_blocks() -> Sequence[bytes]:
    messages = [bytes(frames.integer(0) + frames.integer(40) + bytes((3,)) + b"abc"), b"", frames.integer(77)]
    return [b"".join(frames.block(number, message) for number, message in enumerate(messages))]


WORDS: Final = b"""{
"app": "Klipper", "version": "v0.12",
"commands": {"identify offset=%u count=%c": 1, "get_uptime": 7, "queue_step oid=%c interval=%u count=%hu add=%hi": 9},
"responses": {"identify_response offset=%u data=%.*s": 0, "uptime high=%u clock=%u": 77, "stats count=%u sum=%i": 80},
"config": {
"CLOCK_FREQ": 12000000, "MCU": "fake", "RECEIVE_WINDOW": 192, "RESERVE_PINS_serial": "gpio0,gpio1"
},
"enumerations": {
"pin": {"gpio0": [0, 30], "ADC": 40},
"spi_bus": {"spi0": [0, 2]},
"static_string_id": {"Timer too close": 2, "Shutdown": 3}
}
}"""
DICTIONARY: Final = Dictionary.of_bytes(zlib.compress(WORDS))


def _dictionary(data: bytes) -> None:
    found = Dictionary.of_bytes(zlib.compress(data))
    found.missing({"identify": ("offset", "count")})
    _ = found.frequency, found.mcu, found.receive_window, found.pins, found.reserved


def _packed(data: bytes) -> None:
    Dictionary.of_bytes(data)


def _comport(data: bytes) -> None:
    port = ComPort(FORMAT, "line", echoes=True)
    for place in range(0, len(data), 5):
        chars, answer = port.receive(data[place : place + 5])
        assert len(answer) <= 1000
        assert len(chars) <= 1000


def _request(data: bytes) -> object:
    async def read() -> object:
        reader = asyncio.StreamReader(limit=http1.LONGEST_HEAD)
        reader.feed_data(data)
        reader.feed_eof()
        return await http1.read(reader, None)  # type: ignore[arg-type]

    return asyncio.run(read())


def _arguments(data: bytes) -> None:
    given = json.loads(data)
    if isinstance(given, dict):
        for verb in verbs.VERBS.values():
            known = {parameter.name for parameter in verb.parameters}
            for name, value in given.items():
                if name in known:
                    try:
                        verb.read({name: value})
                    except AskedWrongly as wrong:
                        _in_a_line(wrong)


def _in_a_line(error: Exception) -> None:
    text = str(error)
    if not text or len(text) > LONGEST_ERROR or "\n" in text:
        raise RuntimeError(f"an error of {len(text)} characters: {text[:200]!r}")


def _words(data: bytes) -> None:
    text = data.decode("latin-1")
    for read in (parse_duration, EndpointSpec.parse):
        try:
            read(text)
        except ValueError as error:
            _in_a_line(error)


TELNET: Final = b"\xff\xfb\x2c\xff\xfd\x00\xff\xfa\x2c\x01\x00\x00\x25\x80\xff\xf0V1\r\xff\xfa\x2c\x05\x05\xff\xf0+9\r"
TARGETS: Final[dict[str, Target]] = {
    "cell files": Target(_cell, (Problem,), _cells),
    "motors": Target(lambda data: own.read(data.decode("utf-8", "replace"), "m.toml"), (MotorError,), lambda: [MOTOR]),
    "backups": Target(lambda data: Backup.parse(data.decode("utf-8", "replace")), (BackupError,), lambda: [BACKUP]),
    **{f"programs, {model}": Target(_assembled(model), (AssemblyFailed,), _programs)
       for model in ("gs-c200", "gs-c200s", "dcb-274")},
    **{f"program images, {model}": Target(_decoded(model), (ImageError,), _images(model), False)
       for model in ("gs-c200", "gs-c200s", "dcb-274")},
    **{f"memories, {model.name}": Target(_restored(number), (ImageError,), _kept(number), False)
       for number, model in enumerate(MODELS)},
    "blocks of boards": Target(_blocks, (), _good_blocks, False),
    "dictionaries": Target(_dictionary, (ValueError,), lambda: [WORDS]),
    "packed dictionaries": Target(_packed, (ValueError,), lambda: [zlib.compress(WORDS)], False),
    "RFC 2217": Target(_comport, (), lambda: [TELNET], False),
    "requests": Target(_request, (http1.Unreadable, EOFError),
                       lambda: [b"POST /step HTTP/1.1\r\nHost: localhost\r\nContent-Length: 2\r\n\r\n{}"], False),
    "arguments": Target(_arguments, (ValueError, RecursionError), lambda: [
        b'{"unit": "bar", "pin": "bar.UI1", "level": 1, "time": "20 ms", "timeout": 3, "pace": 2, "on": "off", '
        b'"data": "V1", "rate": 0.5, "nth": 3, "seed": 4, "last": 5, "position": 6, "axis": "X"}']),
    "words": Target(_words, (), lambda: [b"1.5 ms", b"tcp:127.0.0.1:4001", b"pty:/tmp/x", b"1e5 s"]),
}  # fmt: skip


def data(name: str, number: int) -> bytes:
    """The case of that number: something that is nearly right, or not right at all."""
    target, draw = TARGETS[name], Random(f"{name} {number}")
    seed = draw.choice(target.seeds())
    if not target.texts:
        return damaged_image(seed, draw) if draw.random() < 0.8 else draw.randbytes(draw.randint(0, 200))
    lines = seed.decode("utf-8").split("\n")
    for _ in range(draw.choice((1, 1, 1, 2, 3, 6))):
        _damage(lines, draw)
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def _damage(lines: list[str], draw: Random) -> None:
    """One thing more that is wrong."""
    place = draw.randrange(len(lines)) if lines else 0
    line = lines[place] if lines else ""
    match draw.randrange(9):
        case 0 | 1 | 2:  # another value: behind = or :, or in place of a word
            for separator in (" = ", ": ", " "):
                head, found, tail = line.partition(separator)
                if found:
                    rest = "," + tail.partition(",")[2] if "," in tail and draw.random() < 0.5 else ""
                    lines[place : place + 1] = [head + found + draw.choice(NASTY) + rest]
                    return
        case 3:
            del lines[place : place + 1]
        case 4:
            lines.insert(place, draw.choice(lines or [""]))
        case 5 if line:
            at = draw.randrange(len(line))
            lines[place] = (
                line[:at] + chr(draw.choice((0, 7, 9, 27, 34, 91, 93, 127, 0xE9, 0x2028, 0x1F600))) + line[at:]
            )
        case 6 if line:
            at = draw.randrange(len(line))
            lines[place] = line[:at] + line[at + draw.randint(1, 4) :]
        case 7 if len(lines) > 1:
            other = draw.randrange(len(lines))
            lines[place], lines[other] = lines[other], lines[place]
        case 8 if line.split():
            known = line.split()
            lines[place] = line.replace(draw.choice(known), draw.choice([*known, "a.b", "x" * 300, "-"]), 1)


def check(name: str, number: int, tally: Tally) -> None:
    """Read the case of that number. Raises whatever is no refusal in a line of words."""
    check_data(name, data(name, number), tally)


def check_data(name: str, given: bytes, tally: Tally) -> None:
    """Read these bytes."""
    target = TARGETS[name]
    tally.frames += 1
    try:
        target.read(given)
    except AssemblyFailed:
        tally.refused += 1  # an error a line, and each has its bound: see test_assembler_bounds
    except target.raises as error:
        tally.refused += 1
        if not isinstance(error, EOFError | RecursionError):
            _in_a_line(error)
