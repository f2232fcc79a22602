"""The symbolic assembler: source with labels and comments -> instructions at byte addresses, and back.

It knows no controller. What it must know of one - how a command is written, how long it is, which of its
arguments is an address, where programs may stand - comes from a `Language`, which the controller's
`program` module provides from its own table.

Source is one command a line, as typed on the wire; `label:` stands on a line of its own or before a
command; a comment runs from the language's comment character to the end of the line. A label may stand
wherever the language takes an address. Label names are a letter or underscore followed by letters,
figures and underscores; upper and lower case differ.

A source in error raises `AssemblyFailed`, which holds every error, not only the first; of very many the first hundred.
Work and report grow no faster than the source, and what cannot be the source of a program is refused unread.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final, Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

from detent.nearest import did_you_mean

Ins = TypeVar("Ins")  # an instruction of the language, whatever it is
Out = TypeVar("Out", covariant=True)

NAME: Final = re.compile("[A-Za-z_][A-Za-z0-9_]*")
_LABEL: Final = re.compile(r"\s*([^\s:]+)\s*:")
_WORD: Final = re.compile("[A-Za-z_]{3}[A-Za-z0-9_]*")
_LINE_END: Final = re.compile(r"\r\n|\r|\n")

LONGEST_SOURCE: Final = 1 << 18  # characters: a memory of 2 048 bytes with a hundred characters of comment to each
LONGEST_LINE: Final = 1000  # characters without the comment
LONGEST_LABEL: Final = 80  # characters
MOST_ERRORS: Final = 100
_MOST_COMPARED: Final = 1_000  # labels, while looking for those that an unknown one is similar to
_SHOWN: Final = 160  # characters of a wrong line, on either side of the column


class StatementError(Exception):
    """A statement that the language cannot take: `message` with a remedy, `offset` into the statement."""

    def __init__(self, message: str, offset: int = 0) -> None:
        super().__init__(message)
        self.message = message
        self.offset = offset


class ImageError(Exception):
    """An image that holds no program of the language; the text says at which byte and why."""


class Statement(NamedTuple, Generic[Ins]):
    """What a source line says: an instruction, where the next one stands (`origin`), or that a part `ends`.

    `label` is the name written for the instruction's address, at `label_offset` in the statement; the
    instruction then carries any valid address in its place. What ends a part where none has begun begins one at the
    first address.
    """

    instruction: Ins | None
    label: str | None = None
    label_offset: int = 0
    origin: int | None = None
    ends: bool = False


class Language(Protocol[Ins]):
    """A controller's program language, as far as the assembler must know it."""

    @property
    def model(self) -> str:
        """The model name."""

    @property
    def comment(self) -> str:
        """The character that opens a comment."""

    @property
    def areas(self) -> tuple[range, ...]:
        """The addresses at which bytes of a program may stand; a program starts at the first."""

    @property
    def blank(self) -> int:
        """The value of a byte between two parts of a program."""

    @property
    def closed(self) -> bool:
        """Whether a jump must end at an instruction of the same source."""

    def parse(self, text: str) -> Statement[Ins]:
        """The statement in `text`, which has no comment, label or space around it. StatementError if none."""

    def length(self, instruction: Ins) -> int:
        """Bytes that it takes."""

    def target(self, instruction: Ins) -> int | None:
        """The address to which it leads; None if it has no such argument."""

    def with_target(self, instruction: Ins, address: int) -> Ins:
        """The same instruction, leading to `address`. StatementError where it cannot lead there."""

    def encode(self, instruction: Ins) -> bytes:
        """Its bytes in memory."""

    def decode(self, image: bytes) -> list[tuple[int, Ins]]:
        """Each instruction of an image with its address, in order. ImageError if it holds something else."""

    def spell(self, instruction: Ins, label: str | None = None) -> str:
        """The command in source, as the controller lists it; with `label` in place of its address."""


@runtime_checkable
class Ended(Protocol[Out]):
    """What a language has besides in which a jump must lead to an instruction, and none of these ends a program."""

    @property
    def ending(self) -> Out | None:
        """What does nothing behind the last instruction: put there for a label that stands there and is jumped to."""


@runtime_checkable
class Remains(Protocol):
    """What a language has besides in whose memory the rest of an older program may stand behind the end of another."""

    def left_over(self, image: bytes) -> list[range]:
        """The bytes of an image that belong to no program, though they are not blank."""


@runtime_checkable
class Closed(Protocol):
    """What a language has besides in which a part of a program ends with a byte of its own, `blank`, behind it."""

    @property
    def closing(self) -> str:
        """The line that puts it there."""


class SourceError(NamedTuple):
    """One thing wrong with a source: line and column count from 1; the message holds a remedy."""

    line: int
    column: int
    message: str


class AssemblyFailed(Exception):
    """A source with errors, the first `MOST_ERRORS` of them in the order of its lines. Its text is for a person."""

    def __init__(self, name: str, lines: tuple[str, ...], errors: Iterable[SourceError]) -> None:
        self.name = name
        self.lines = lines
        self.errors = tuple(sorted(errors))[:MOST_ERRORS]
        super().__init__("\n".join(self._reports()))

    def _reports(self) -> Iterator[str]:
        for line, column, message in self.errors:
            begin = max(column - 1 - _SHOWN, 0) if column - 1 > 2 * _SHOWN else 0
            shown = self.lines[line - 1][begin : column - 1 + _SHOWN]
            # a control character in the source, say of an image taken for one, must not reach a terminal
            source = "".join(c if c.isprintable() or c == "\t" else "?" for c in shown)
            # a tab stays a tab, so that the caret stands under its column however wide tabs are shown
            margin = re.sub(r"[^\t]", " ", source[: column - 1 - begin])
            yield f"{self.name}:{line}:{column}: {message}\n    {source}\n    {margin}^"
        if len(self.errors) == MOST_ERRORS:
            yield f"{self.name}: these are {MOST_ERRORS} errors; mend them, then the rest is looked at"


class Placed(NamedTuple, Generic[Ins]):
    """An instruction at its address: its bytes, how it is listed, and where the source has it."""

    address: int
    instruction: Ins
    code: bytes
    text: str
    line: int
    column: int


@dataclass(frozen=True)
class Assembly(Generic[Ins]):
    """A program without errors: what was written, and what it comes to."""

    language: Language[Ins]
    name: str
    lines: tuple[str, ...]
    placed: tuple[Placed[Ins], ...]
    symbols: Mapping[str, int]

    @property
    def instructions(self) -> tuple[Ins, ...]:
        """The instructions in source order."""
        return tuple(placed.instruction for placed in self.placed)

    @property
    def commands(self) -> tuple[str, ...]:
        """The commands as they go on the wire: addresses in place of labels, no comments."""
        return tuple(placed.text for placed in self.placed)

    @property
    def typed(self) -> tuple[str, ...]:
        """`commands`, and where the language has parts the lines between them that say where each one stands.

        Assembled again they give the same bytes at the same addresses.
        """
        origin = getattr(self.language, "origin", None)
        closing = self.language.closing if isinstance(self.language, Closed) else None
        lines: list[str] = []
        here = self.language.areas[0].start
        for placed in self.placed:
            if origin is not None and placed.address != here:
                lines += [closing] if lines and closing is not None else []
                lines.append(origin(placed.address))
            lines.append(placed.text)
            here = placed.address + len(placed.code)
        return tuple(lines)

    @property
    def used(self) -> int:
        """Bytes that the instructions take."""
        return sum(len(placed.code) for placed in self.placed)

    @property
    def capacity(self) -> int:
        """Bytes that the language has for programs."""
        return sum(len(area) for area in self.language.areas)

    @property
    def base(self) -> int:
        """The address of the image's first byte."""
        return min((placed.address for placed in self.placed), default=self.language.areas[0].start)

    @property
    def image(self) -> bytes:
        """The bytes from the first instruction to the last, whatever lies between them blank."""
        end = max((placed.address + len(placed.code) for placed in self.placed), default=self.base)
        image = bytearray([self.language.blank]) * (end - self.base)
        for placed in self.placed:
            start = placed.address - self.base
            image[start : start + len(placed.code)] = placed.code
        return bytes(image)

    @property
    def whole(self) -> bytes:
        """The image from the first address of the program memory on: so it is kept in files, and taken from them."""
        return bytes([self.language.blank]) * (self.base - self.language.areas[0].start) + self.image


class _Line(NamedTuple, Generic[Ins]):
    """A source line that holds an instruction, before labels have their addresses."""

    number: int
    column: int
    address: int
    statement: Statement[Ins]
    instruction: Ins
    length: int


class _Assembler(Generic[Ins]):
    """One run over one source: the first pass places instructions and labels, the second aims the jumps."""

    def __init__(self, language: Language[Ins], source: str, name: str) -> None:
        self.language = language
        self.name = name
        self.lines = tuple(_LINE_END.split(source))
        self.errors: list[SourceError] = []
        self.found: list[_Line[Ins]] = []
        self.taken: dict[int, _Line[Ins]] = {}  # byte -> the instruction that holds it
        self.symbols: dict[str, int] = {}
        self.defined: dict[str, int] = {}  # label -> line
        self.pending: list[str] = []  # labels that wait for their instruction
        self.behind: frozenset[str] = frozenset()  # those that wait in vain, once everything is read
        self.compared = 0  # labels, with unknown ones
        self.address = language.areas[0].start
        self.area: range | None = language.areas[0]  # where the present part stands
        self.overflow: tuple[_Line[Ins], range] | None = None  # the first instruction that does not fit
        self.certain = True  # False once addresses are off: a line could not be read, or did not fit
        self.begun = False  # a part, by an instruction or by where it stands
        self.ended = 0  # the line that has ended a part, while no other has begun

    def run(self) -> Assembly[Ins]:
        """Both passes. Raises AssemblyFailed."""
        for number, line in enumerate(self.lines, start=1):
            self.read(number, line.partition(self.language.comment)[0])
            if len(self.errors) >= MOST_ERRORS:
                break
        else:
            self.end()
            if not self.ended and self.found:
                self.close(self.found[-1].number, self.found[-1].column)
            self.report_overflow()
        if len(self.errors) >= MOST_ERRORS:
            raise AssemblyFailed(self.name, self.lines, self.errors)
        aimed = [self.aim(line) for line in self.found]
        if self.errors:
            raise AssemblyFailed(self.name, self.lines, self.errors)
        placed = tuple(map(self.placed, self.found, aimed))
        return Assembly(self.language, self.name, self.lines, placed, self.symbols)

    def placed(self, line: _Line[Ins], instruction: Ins) -> Placed[Ins]:
        """The outcome for one instruction whose jump is aimed."""
        code, text = self.language.encode(instruction), self.language.spell(instruction)
        return Placed(line.address, instruction, code, text, line.number, line.column)

    def wrong(self, line: int, column: int, message: str) -> None:
        """Note an error."""
        self.errors.append(SourceError(line, column, message))

    def read(self, number: int, text: str) -> None:
        """First pass over one line without its comment."""
        if len(text) > LONGEST_LINE:
            self.certain = False
            self.settle()
            told = f"a line of {len(text)} characters is too long: at most {LONGEST_LINE} without the comment"
            self.wrong(number, 1, f"{told}; one command a line")
            return
        start = 0
        while match := _LABEL.match(text, start):
            self.label(match[1], number, match.start(1) + 1)
            start = match.end()
        statement = text[start:].strip()
        if not statement:
            return
        column = text.index(statement, start) + 1
        try:
            parsed = self.language.parse(statement)
        except StatementError as error:
            self.certain = False
            self.settle()
            hint = f"; if it is a label, write {statement}:" if _WORD.fullmatch(statement) else ""
            self.wrong(number, column + error.offset, error.message + hint)
            return
        origin = parsed.origin
        if (parsed.ends or origin is not None) and self.begun and not self.ended:
            self.close(number, column)
        if parsed.ends and self.begun and not self.ended:
            self.ended = number
        elif parsed.ends:
            origin = self.language.areas[0].start
        if origin is not None:
            self.begun, self.ended = True, 0
            self.move_to(origin, number, column)
        if parsed.instruction is not None:
            self.begun = True
            if self.ended:
                where = f"it stands behind the end of a part, on line {self.ended}, and belongs to none"
                self.wrong(number, column, f"{where}; say where it stands, or take that line out")
            length = self.language.length(parsed.instruction)
            self.place(_Line(number, column, self.address, parsed, parsed.instruction, length))

    def label(self, name: str, line: int, column: int) -> None:
        """Note a label: it names the address of the instruction that comes next."""
        if not NAME.fullmatch(name):
            rule = "a letter or _, then letters, figures and _"
            self.wrong(line, column, f"{name!r} is no name for a label: it takes {rule}")
        elif len(name) > LONGEST_LABEL:
            self.wrong(line, column, f"a label of {len(name)} characters is too long; at most {LONGEST_LABEL}")
        elif name in self.defined:
            first = self.defined[name]
            self.wrong(line, column, f"label {name} is defined twice, first on line {first}; rename one")
        else:
            self.defined[name] = line
            self.pending.append(name)

    def settle(self) -> None:
        """The labels that wait name the present address."""
        self.symbols.update(dict.fromkeys(self.pending, self.address))
        self.pending.clear()

    def move_to(self, origin: int, line: int, column: int) -> None:
        """The next instruction stands at `origin`."""
        self.report_overflow()
        self.address = origin
        self.area = next((area for area in self.language.areas if origin in area), None)
        if self.area is None:
            room = ", ".join(f"{area.start}-{area.stop - 1}" for area in self.language.areas)
            self.wrong(line, column, f"no program may stand at {origin}; choose from {room}")

    def place(self, line: _Line[Ins]) -> None:
        """Put an instruction at the present address."""
        self.settle()
        self.found.append(line)
        self.address = line.address + line.length
        for byte in range(line.address, self.address):
            if byte in self.taken:
                held = f"byte {byte} already holds the instruction of line {self.taken[byte].number}"
                self.wrong(line.number, line.column, f"{held}; choose another start")
                break
        self.taken.update(dict.fromkeys(range(line.address, self.address), line))
        if self.area is not None and self.address > self.area.stop and self.overflow is None:
            self.overflow = line, self.area

    def end(self) -> None:
        """A label behind the last instruction to which a jump leads gets an instruction of its own."""
        ending = self.language.ending if isinstance(self.language, Ended) else None
        led = {line.statement.label for line in self.found}
        label = next((label for label in self.pending if label in led), None)
        if label is None or ending is None:
            self.behind = frozenset(self.pending)
            self.settle()
            return
        number = self.defined[label]
        column = self.lines[number - 1].index(label) + 1
        self.place(_Line(number, column, self.address, Statement(ending), ending, self.language.length(ending)))

    def close(self, number: int, column: int) -> None:
        """The part ends here: the byte behind it may not be an instruction of another, which its end mark would hit."""
        if isinstance(self.language, Closed) and self.address in self.taken:
            held = (
                f"the end mark of this part would stand at {self.address}, where line {self.taken[self.address].number}"
            )
            self.wrong(number, column, f"{held} has put an instruction; leave a byte between them")

    def report_overflow(self) -> None:
        """Say by how much the part that ends here is too long, at the first instruction that does not fit."""
        if self.overflow is None:
            return
        line, area = self.overflow
        self.overflow = None
        self.certain = False
        over, memory = self.address - area.stop, len(area)
        self.wrong(
            line.number,
            line.column,
            f"the program is {over} byte{'s' * (over > 1)} too long: it needs {memory + over} of {memory}, "
            "and this is the first instruction that does not fit",
        )

    def aim(self, line: _Line[Ins]) -> Ins:
        """Second pass over one instruction: its address argument checked, its label resolved."""
        if len(self.errors) >= MOST_ERRORS:
            return line.instruction
        label = line.statement.label
        if label is None:
            target = self.language.target(line.instruction)
            if target is not None and self.certain:
                self.check_target(line, target)
            return line.instruction
        column = line.column + line.statement.label_offset
        if label not in self.symbols:
            self.wrong(line.number, column, f"no label {label} is defined{self.similar(label)}")
        elif label in self.behind and self.language.closed:
            behind = f"label {label} stands behind the last instruction, where there is nothing to jump to"
            self.wrong(line.number, column, f"{behind}; put an instruction behind it")
        else:
            try:
                return self.language.with_target(line.instruction, self.symbols[label])
            except StatementError as error:
                self.wrong(line.number, column, f"label {label} stands at {self.symbols[label]}: {error.message}")
        return line.instruction

    def similar(self, label: str) -> str:
        """The remedy for an unknown label."""
        self.compared += len(self.symbols)
        near = self.symbols if self.compared <= _MOST_COMPARED and len(label) <= LONGEST_LABEL else ()
        hint = did_you_mean(label, near, 0.6).strip()
        return f"; {hint}" if hint else f"; write {label}: before an instruction"

    def check_target(self, line: _Line[Ins], target: int) -> None:
        """A jump to a number must end at an instruction, or outside this source if the language is open."""
        held = self.taken.get(target)
        if held is not None and held.address != target:
            message = (
                f"address {target} lies inside the instruction of line {held.number}, which takes bytes "
                f"{held.address} to {held.address + held.length - 1}; jump to {held.address} or use a label"
            )
        elif held is None and self.language.closed:
            message = f"no instruction starts at address {target}: the program ends at {self.address - 1}"
        else:
            return
        self.wrong(line.number, line.column, message)


def assemble(language: Language[Ins], source: str, name: str = "program") -> Assembly[Ins]:
    """The program in `source`; `name` is what reports call it. Raises AssemblyFailed with every error.

    The ^Z with which tools of DOS end a file is no part of it.
    """
    if len(source) > LONGEST_SOURCE:
        told = f"{len(source)} characters are too many: at most {LONGEST_SOURCE}; leave out what is no program"
        raise AssemblyFailed(name, (source[:_SHOWN].split("\n")[0],), [SourceError(1, 1, told)])
    text = source.rstrip()
    return _Assembler(language, text.rstrip("\x1a") if text.endswith("\x1a") else source, name).run()


def listing(assembly: Assembly[Ins]) -> str:
    """A table of address, bytes, image in hex and source, line by line, with the total behind it."""
    placed = {each.line: each for each in assembly.placed}
    width = max((len(each.code) for each in assembly.placed), default=0) * 3
    rows = [f"address  bytes  {'image':<{max(width, 5)}}  source"]
    for number, source in enumerate(assembly.lines, start=1):
        each = placed.get(number)
        if each is None:
            rows.append(f"{'':16}{'':<{max(width, 5)}}  {source}".rstrip())
        else:
            code = each.code.hex(" ").upper()
            rows.append(f"{each.address:7}  {len(each.code):5}  {code:<{max(width, 5)}}  {source}".rstrip())
    while len(rows) > 1 and not rows[-1]:
        rows.pop()
    rows.append(f"{assembly.used} bytes used of {assembly.capacity}")
    return "\n".join(rows) + "\n"


def disassemble(language: Language[Ins], image: bytes) -> str:
    """Source that assembles to `image`, with a label `at_N` where a jump leads. Raises ImageError.

    A jump to no instruction of the image keeps its number, and a comment says so if the language is closed. What is
    left of an older program is told in comments.
    """
    decoded = language.decode(image)
    starts = {address for address, _ in decoded}
    targets = {target for _, instruction in decoded if (target := language.target(instruction)) is not None}
    lines = []
    here = language.areas[0].start
    origin = getattr(language, "origin", None)  # of those whose programs may have gaps
    for address, instruction in decoded:
        if origin is not None and address != here:
            lines.append(origin(address))
        here = address + language.length(instruction)
        if address in targets:
            lines.append(f"at_{address}:")
        target = language.target(instruction)
        text = language.spell(instruction, f"at_{target}" if target in starts else None)
        if target is not None and target not in starts and language.closed:
            text += f"  {language.comment} no instruction starts at {target}"
        lines.append(text)
    for left in language.left_over(image) if isinstance(language, Remains) else ():
        data = image[left.start : left.stop].hex(" ").upper()
        lines.append(f"{language.comment} left of an older program at {left.start}, behind an end mark: {data}")
    return "".join(line + "\n" for line in lines)
