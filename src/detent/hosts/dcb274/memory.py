"""Programs and NV memory of a DCB-274: listing, storing, backing up, restoring (pages 24, 31, 32, 47 to 49, 56).

Q lists programs as text, but in single mode only (page 48); where lines have names there are only the bytes that [
reads, and the manual does not say what they mean, except that FFh ends a program (page 47). So text is read in single
mode, bytes are kept in every mode, and a restore writes bytes.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from detent.hosts.dcb274.answers import Listed, Listing
from detent.hosts.dcb274.commands import CELLS_AT_ONCE, Commands
from detent.hosts.dcb274.handshake import CR, SINGLE_LONGEST
from detent.hosts.dcb274.programs import END, NO_PROGRAM, SHADOW, SIZE, behind, holds, led_to, left_over
from detent.hosts.dcb274.ranges import LARGEST_ADDRESS, between, program_address
from detent.hosts.dcb274.single_mode import SingleMode
from detent.hosts.errors import BadAnswer, Busy, DriverError, Refused, Spoken
from detent.hosts.exchange import Ask, Progress, Steps, operation

PAGE: Final = 20  # lines of a listing (page 48)
BYTES_A_LINE: Final = 16  # of a backup
STATUS_BYTE, NAME = 228, 247  # "do NOT modify" (page 31); the name
_OPTIONS_AT, _DIVIDE_AT, _JOG_AT, _RAMP_AT, _TRIP_AT, _PORTS_AT, _TABLE_AT = 227, 229, 238, 240, 242, 245, 246
_STORING: Final = 0.05  # seconds for one instruction of program mode

# NV bytes of the instructions (pages 33 to 57; Z, T and w as their examples need them): what a program may hold.
LENGTHS: Final = {
    **dict.fromkeys("@^", 1), **dict.fromkeys("AbDEHlwZ]|", 2), **dict.fromkeys("BFGIKMVWY", 3),
    **dict.fromkeys("+-ROJL", 4), **dict.fromkeys("Tik", 5),
}  # fmt: skip
_RATES: Final = "IVMF"  # are listed as the timer makes them, not as they were typed


class HalfWritten(DriverError):
    """NV memory was written in part. `before` is all of it as it was."""

    before: bytes = b""


class Block(NamedTuple):
    """Instructions that stand one behind the other from `address` on."""

    address: int
    texts: list[str]


class Memory(Commands):
    """What stands in the memory of one axis."""

    # -- programs ----------------------------------------------------------------------------------------

    @operation
    def listing(self, address: int = 0) -> Steps[Listing]:
        """Q: the program from `address` on (page 48), page by page. Single mode only."""
        if not isinstance(self._way, SingleMode):
            raise ValueError("programs are listed in single mode only (page 48); read_memory() reads their bytes")
        text = f"Q{between(address, 0, LARGEST_ADDRESS, 'an address')}"
        if not self._connected:
            yield from self.connect()
        if self._way.running:
            yield from self._see_it_over()
        lines = yield from self._unbroken(self._lines(self._way, text, address))
        try:
            return Listing.parse(lines)
        except ValueError:
            raise BadAnswer(self.title, f"lists {lines!r} from {address} on") from None

    def _lines(self, way: SingleMode, text: str, address: int) -> Steps[list[str]]:
        """What `text` lists, to the bare end address."""
        yield from way.enter(text)
        lines: list[str] = []
        while not lines or not lines[-1].isdigit():
            answer = yield Ask(CR, _page, way.patience + 1.0)
            spoken = Spoken((text if not lines else "").encode() + CR, answer.data)
            if answer.data == b"#\r\n":
                raise way.refused(text, spoken)
            if not answer.whole:
                self._connected = False
                raise BadAnswer(self.title, f"does not finish its listing from {address} on", spoken)
            lines += _printed(answer.data)
        return lines

    @operation
    def read_program(self, address: int | None = None) -> Steps[list[str]]:
        """The program at `address`, or every program of the memory, as lines that `write_program` takes.

        A line ``P 256`` says where the next ones stand. Programs are looked for in the bytes of the whole memory,
        which takes about ten seconds at 9600 baud. What is left of an older program behind an end mark is none
        (`programs`): `left_over` tells where it stands. Single mode only.
        """
        if address is not None:
            program_address(address)
            return _source([(yield from self.listing(address))], [address])
        if self.mode != "single":
            raise ValueError("programs are listed in single mode only (page 48); read_memory() reads their bytes")
        return (yield from self._programs((yield from self._all("looking for programs"))))

    def _programs(self, memory: bytes) -> Steps[list[str]]:
        """Every program, found by the bytes that are no end mark; and the one in RAM at 128, whatever NV memory has."""
        found: dict[int, Listing] = {}
        address = 0
        while address < SIZE:
            if address in NO_PROGRAM:
                address = NO_PROGRAM.stop
            elif memory[address] == END and address != SHADOW.start:
                address += 1
            else:
                yield Progress(address, SIZE, "listing programs")
                listing = yield from self.listing(address)
                if listing.lines:
                    found[address] = listing
                    address = behind(memory, max(listing.end, address + 1))
                else:
                    address += 1
        asked: set[int] = set()
        while places := [at for at in led_to(found.values()) - asked if memory[at] != END and not holds(found, at)]:
            asked.add(min(places))
            listing = yield from self.listing(min(places))
            if listing.lines:
                found[min(places)] = listing
        left = left_over(memory, found)
        self.left_over = _spans(left) if left else ""
        return _source([found[at] for at in sorted(found)], sorted(found))

    @operation
    def write_program(self, lines: Sequence[str], address: int = 0) -> Steps[list[Listed]]:
        """Store instructions by program mode (page 47), and see that they are there; where each of them stands.

        One instruction a line, as it is typed; ``P 256`` says where the next ones stand, a number in front of an
        instruction may say where it stands itself, so that a listing can be written back. An end mark follows each
        block. Where lines have names, only the end marks can be seen. Raises ValueError before anything is written.
        """
        blocks = blocks_of(lines, address, self._way.longest)
        stored: list[Listed] = []
        total = sum(len(block.texts) for block in blocks)
        for block in blocks:
            stored += yield from self._store(block, len(stored), total)
        for block in blocks:
            yield from self._verify(block)
        yield Progress(total, total, "stored")
        return stored

    def _store(self, block: Block, done: int, total: int) -> Steps[list[Listed]]:
        stored: list[Listed] = []
        address = block.address
        yield from self._line(f"P{address}")
        self._storing = True
        try:
            for text in block.texts:
                yield Progress(done + len(stored), total, f"storing {text}")
                yield from self._line(text, _STORING, typed=True)
                stored.append(Listed(address, text))
                address += LENGTHS[text[0]]
        except Refused as error:
            # ESC would leave the rest of an older program behind the new instructions, and stop every axis.
            yield from self._line("P", _STORING, typed=True)
            self._storing = False
            what = f"{error.what}; new instructions stand at {block.address} to {address - 1}, an end mark at {address}"
            raise Refused(self.title, what, error.spoken, error.code) from None
        yield from self._line("P", _STORING, typed=True)
        self._storing = False
        return stored

    def _verify(self, block: Block) -> Steps[None]:
        """Raises BadAnswer if something else stands in memory."""
        end = block.address + sum(LENGTHS[text[0]] for text in block.texts)
        if self.mode == "single":
            listing = yield from self.listing(block.address)
            same = listing.end == end and len(listing.lines) == len(block.texts)
            if not same or any(_words(a.text) != _words(b) for a, b in zip(listing.lines, block.texts, strict=True)):
                listed = "; ".join(map(str, listing.lines)) or "nothing"
                raise BadAnswer(self.title, f"does not hold what was stored from {block.address} on, but: {listed}")
            return
        if end in SHADOW or end in NO_PROGRAM or end >= SIZE:
            return  # [ does not read the RAM at 128-191, and where no program may stand there is no end mark
        if (yield from self.read_memory(end)) != bytes((END,)):
            raise BadAnswer(self.title, f"has no end mark at {end}, behind what was stored from {block.address} on")

    # -- backups -----------------------------------------------------------------------------------------

    @operation
    def saved(self) -> Steps[dict[str, object]]:
        """What the unit keeps and tells: ``memory`` (2048 bytes, hex, 16 a line), ``program``, ``parameters``.

        The text of programs and the speeds are there in single mode only. What restore writes is ``memory``; the
        rest is for reading. Settings that were not kept by `save` are not in it.
        """
        memory = yield from self._all("reading NV memory")
        kept: dict[str, object] = {}
        if self.mode == "single":
            kept["program"] = yield from self._programs(memory)
        kept["memory"] = hex_lines(memory)
        parameters: dict[str, object] = {
            "name": chr(memory[NAME]) if 0x21 <= memory[NAME] <= 0x7E else "",
            "divide": memory[_DIVIDE_AT],
            "ramp_up": memory[_RAMP_AT],
            "ramp_down": memory[_RAMP_AT + 1],
            "jog_slow": memory[_JOG_AT],
            "jog_fast": memory[_JOG_AT + 1],
            "resolution": memory[_TABLE_AT],
            "options": memory[_OPTIONS_AT],
            "trip_position": int.from_bytes(memory[_TRIP_AT : _TRIP_AT + 3], "little", signed=True),
            "trip_ports": memory[_PORTS_AT],
        }
        if self.mode == "single":
            settings = yield from self.examine()
            parameters |= {"initial_velocity": settings.initial, "slew_velocity": settings.slew}
            if settings.decay is not None:
                parameters["decay"] = settings.decay
        kept["parameters"] = parameters
        return kept

    @operation
    def restore(self, saved: Mapping[str, object]) -> Steps[list[str]]:
        """Write the ``memory`` of a backup back, see that it is there, load the settings from it; what was done.

        Only bytes that differ are written: memory wears. Address 228 is the unit's own (page 31), and on a line of
        several axes the name stays. The axis must stand. Raises ValueError, Busy, HalfWritten.
        """
        wanted = bytes_of(saved)
        if (yield from self._number("^")) & 3:
            raise Busy(self.title, "moves", advice="wait() or stop() before a restore")
        before = yield from self._all("reading what is there")
        left = (STATUS_BYTE,) if self.mode == "single" else (STATUS_BYTE, NAME)
        places = [a for a in range(SIZE) if wanted[a] != before[a] and a not in left]
        done = 0
        try:
            for address in places:
                yield Progress(done, len(places), "writing NV memory")
                yield from self.write_memory(address, wanted[address])
                done += 1
            now = yield from self._all("reading it back", places)
            wrong = [address for address in places if now[address] != wanted[address]]
            if wrong:
                raise BadAnswer(self.title, f"does not keep what was written at {_spans(wrong)}")
            yield from self.reload()
        except DriverError as error:
            failed = HalfWritten(self.title, f"{_state(places, done)}; {error.what}", error.spoken)
            failed.before = before
            raise failed from error
        yield Progress(len(places), len(places), "restored")
        return [*_report(places), *(_left(a, wanted[a], before[a]) for a in left if wanted[a] != before[a])]

    def _all(self, what: str, places: Sequence[int] | None = None) -> Steps[bytes]:
        """The NV memory; with `places`, only the pieces that have one of them, and 0 elsewhere."""
        memory = bytearray(SIZE)
        wanted = {place // CELLS_AT_ONCE for place in (range(SIZE) if places is None else places)}
        for done, piece in enumerate(sorted(wanted)):
            yield Progress(done, len(wanted), what)
            first = piece * CELLS_AT_ONCE
            memory[first : first + CELLS_AT_ONCE] = yield from self.read_memory(first, CELLS_AT_ONCE)
        return bytes(memory)


def blocks_of(lines: Sequence[str], address: int = 0, longest: int = SINGLE_LONGEST) -> list[Block]:
    """What `write_program` is given, as it is typed where a line has `longest` characters.

    It is checked as far as this side can. Raises ValueError that names the line.
    """
    blocks = [Block(program_address(address), [])]
    for number, raw in enumerate(lines, 1):
        text = raw.strip()
        first, _, behind = text.partition(" ")
        if first.isdigit():
            if not behind.strip():
                continue  # the end address of a listing
            address, text = int(first), behind.strip()
        elif text[:1] == "P":
            if text[1:].strip():
                address = _address_in(text, number)
            if address != blocks[-1].address or blocks[-1].texts:
                blocks.append(Block(address, []))
            continue
        if not text:
            continue
        if address != _behind(blocks[-1]):
            blocks.append(Block(address, []))
        if text[0] not in LENGTHS:
            raise ValueError(f"line {number}: {text!r} cannot stand in a program")
        text = _as_typed(text, number, longest)
        blocks[-1].texts.append(text)
        for place in range(address, address + LENGTHS[text[0]]):
            if place in NO_PROGRAM or place >= SIZE:
                raise ValueError(f"line {number}: {text!r} would reach {place}: programs stand at 0-192 and 256-2047")
        address += LENGTHS[text[0]]
    blocks = [block for block in blocks if block.texts]
    taken: set[int] = set()
    for block in blocks:
        places = range(block.address, _behind(block) + 1)  # with its end mark
        if not taken.isdisjoint(places):
            raise ValueError(f"the block at {block.address}, with its end mark, reaches into one before; move it")
        taken.update(places[:-1])
    return blocks


def _as_typed(text: str, line: int, longest: int) -> str:
    """An instruction as it goes over the line; without the blank behind its letter if it is too long with it."""
    text = text.rstrip("; ")
    if not (text.isascii() and text.isprintable()):
        raise ValueError(f"line {line}: {text!r} has a character that cannot be typed")
    if ";" in text:
        raise ValueError(f"line {line}: {text!r} is more than one instruction")
    short = text if len(text) <= longest else text[0] + text[1:].lstrip()
    if len(short) > longest:
        behind = " behind the name" if longest < SINGLE_LONGEST else ""
        raise ValueError(f"line {line}: {text!r} is longer than the {longest} characters{behind} of a line")
    return short


def hex_lines(memory: bytes) -> list[str]:
    """Bytes as a backup has them: 16 a line, in hex."""
    return [memory[at : at + BYTES_A_LINE].hex(" ") for at in range(0, len(memory), BYTES_A_LINE)]


def bytes_of(saved: Mapping[str, object]) -> bytes:
    """The memory in a backup. Raises ValueError."""
    lines = saved.get("memory")
    if not isinstance(lines, list):
        raise ValueError("memory: a backup of a DCB-274 has its bytes here, lines of hex text; this one has none")
    try:
        memory = bytes.fromhex(" ".join(str(line) for line in lines))
    except ValueError:
        raise ValueError("memory: write lines of hex text, like 'eb e9 03 00'") from None
    if len(memory) != SIZE:
        raise ValueError(f"memory: {len(memory)} bytes; the NV memory has {SIZE}")
    return memory


def _page(came: bytes) -> int | None:
    """Complete behind 20 lines of a listing, the bare end address, or a refusal."""
    if came == b"#\r\n":
        return len(came)
    lines = came.split(b"\r\n")[:-1]
    printed = [line for line in lines if line]
    whole = len(printed) == PAGE or (printed and printed[-1].strip().isdigit())
    return sum(len(line) + 2 for line in lines) if whole else None


def _printed(page: bytes) -> list[str]:
    return [line.strip() for line in page.decode("latin-1").split("\r\n") if line.strip()]


def _source(listings: Sequence[Listing], places: Sequence[int]) -> list[str]:
    """Listings as lines for `write_program`."""
    lines: list[str] = []
    for listing, at in zip(listings, places, strict=True):
        lines += [f"P {at}", *(line.text for line in listing.lines)]
    return lines


def _words(text: str) -> tuple[str, ...]:
    """An instruction as it can be compared: letter and numbers, without a rate, which the timer rounds."""
    letter, rest = text[0], text[1:].replace(",", " ").split()
    if letter == "|":
        return letter, *rest
    numbers = [str(int(float(word.rstrip(";") or "0"))) for word in rest]
    if letter in _RATES and numbers:
        numbers[0] = "-" if numbers[0].startswith("-") else "+"
    while numbers and numbers[-1] == "0":
        numbers.pop()  # a number that is left out is 0
    return letter, *numbers


def _address_in(text: str, line: int) -> int:
    try:
        return program_address(int(text[1:]))
    except ValueError as error:
        raise ValueError(f"line {line}: {text!r}: {error}") from None


def _behind(block: Block) -> int:
    return block.address + sum(LENGTHS[text[0]] for text in block.texts)


def _runs(places: Sequence[int]) -> Iterator[tuple[int, int]]:
    """First and last of each run of neighbours."""
    first = last = places[0]
    for place in places[1:]:
        if place != last + 1:
            yield first, last
            first = place
        last = place
    yield first, last


def _spans(places: Sequence[int]) -> str:
    """Addresses for people: ``0-18, 230``."""
    runs = [f"{first}-{last}" if last > first else str(first) for first, last in _runs(places)]
    return ", ".join(runs if len(runs) <= 6 else [*runs[:5], f"... {places[-1]}"])


def _state(places: Sequence[int], done: int) -> str:
    """What is where after a failure."""
    if done == 0:
        at = f"address {places[0]}" if places else "NV memory"
        return f"nothing was written for sure; {at} may be, the rest is as it was"
    new = f"of {len(places)} bytes that differ {done} are new, at {_spans(places[:done])}"
    if done == len(places):
        return f"{new}; the settings were not loaded from them: restore again, or reload()"
    return f"{new}; address {places[done]} may be, the rest is as it was: restore again to go on"


def _report(places: Sequence[int]) -> list[str]:
    if not places:
        return ["NV memory was as in the backup: nothing was written", "settings: loaded from NV memory (C 0)"]
    groups = (
        ("programs", [a for a in places if a not in NO_PROGRAM]),
        ("settings", [a for a in places if a in NO_PROGRAM]),
    )
    lines = [f"{what}: wrote {len(group)} bytes at {_spans(group)}" for what, group in groups if group]
    lines += [f"read back {len(places)} bytes: as in the backup", "settings: loaded from NV memory (C 0)"]
    if any(place in SHADOW for place in places):
        lines.append("programs at 128-191 run from RAM: reset() loads it for sure; do not save() before")
    return lines


def _left(address: int, wanted: int, before: int) -> str:
    if address == NAME:
        return f"name: stays {chr(before)}, and is not {chr(wanted)}: names are given in single mode"
    return f"address {address}: left at {before}, the backup has {wanted}; it is the unit's own (page 31)"
