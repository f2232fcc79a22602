"""What an editor must know of a model's programs: the command table, errors, addresses, the way back to source."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from detent.assembler import Assembly, AssemblyFailed, ImageError, Language, assemble, disassemble
from detent.controllers import catalogue
from detent.controllers.device import CommandHelp

_WORD = re.compile(r"\S+")


class Wrong(NamedTuple):
    """One thing wrong with a source: `length` characters from `column` of `line`, both from 1, and the remedy."""

    line: int
    column: int
    length: int
    message: str


class Place(NamedTuple):
    """Where the instruction of a source line stands in memory."""

    address: int
    code: bytes
    text: str  # as the controller lists it

    @property
    def end(self) -> int:
        """The address behind it."""
        return self.address + len(self.code)


class Checked(NamedTuple):
    """What came of a source. With errors there is no image, and only what could be placed before them."""

    errors: tuple[Wrong, ...]
    places: Mapping[int, Place]  # by line, from 1
    labels: Mapping[str, int]
    used: int  # bytes
    capacity: int
    image: bytes
    base: int  # address of the image's first byte

    def line_at(self, address: int) -> int | None:
        """The line whose instruction stands at `address`."""
        return next((line for line, place in self.places.items() if place.address == address), None)


class Program:
    """The programs of one model. `words` are its commands, for completion, hover help and colours.

    A model without programs has `language` None: its commands are there all the same.
    """

    def __init__(self, model: str) -> None:
        """Raises CatalogueError for an unknown model."""
        found = catalogue.model(model)
        self.model = model
        self.words: tuple[CommandHelp, ...] = tuple(found.commands())
        self.language: Language[Any] | None = found.language() if found.language is not None else None
        self.comment = self.language.comment if self.language is not None else ";"
        self.areas: tuple[range, ...] = self.language.areas if self.language is not None else ()
        self.capacity = sum(len(area) for area in self.areas)

    def check(self, source: str) -> Checked:
        """Assemble `source`. ValueError for a model without programs."""
        try:
            assembly = assemble(self._needed(), source)
        except AssemblyFailed as failed:
            errors = tuple(_wrong(failed.lines, *error) for error in failed.errors)
            sound = self._sound(failed.lines, {error.line for error in errors})
            places, used = (_places(sound), sound.used) if sound is not None else ({}, 0)
            return Checked(errors, places, {}, used, self.capacity, b"", self.areas[0].start)
        return Checked((), _places(assembly), dict(assembly.symbols), assembly.used, self.capacity, assembly.image,
                       assembly.base)  # fmt: skip

    def disassemble(self, image: bytes) -> str:
        """Source that gives `image`. Raises ImageError, ValueError for a model without programs."""
        return disassemble(self._needed(), image)

    def listed(self, image: bytes) -> list[tuple[int, str]]:
        """The instructions of `image` with their addresses, as the controller lists them. Raises ImageError."""
        language = self._needed()
        return [(address, language.spell(instruction)) for address, instruction in language.decode(image)]

    def differences(self, source: str, image: bytes) -> list[int]:
        """The lines of `source` whose bytes are not what `image`, read back from address 0, has there; in order.

        A line behind the end of `image` differs. ValueError if the source has errors.
        """
        checked = self.check(source)
        if checked.errors:
            first = checked.errors[0]
            raise ValueError(f"line {first.line}: {first.message}")
        return [line for line, place in checked.places.items() if image[place.address : place.end] != place.code]

    def _needed(self) -> Language[Any]:
        if self.language is None:
            raise ValueError(f"a {self.model} holds no programs")
        return self.language

    def _sound(self, lines: Sequence[str], wrong: set[int]) -> Assembly[Any] | None:
        """The source without its wrong lines: addresses beside what is right while somebody is still typing."""
        kept = ["" if number in wrong else line for number, line in enumerate(lines, 1)]
        try:
            return assemble(self._needed(), "\n".join(kept))
        except AssemblyFailed:
            return None  # a label that only a wrong line has


def _places(assembly: Assembly[Any]) -> dict[int, Place]:
    return {placed.line: Place(placed.address, placed.code, placed.text) for placed in assembly.placed}


def _wrong(lines: Sequence[str], line: int, column: int, message: str) -> Wrong:
    """The error with the length of the word that it points to."""
    word = _WORD.match(lines[line - 1], column - 1)
    return Wrong(line, column, len(word[0]) if word else 1, message)


__all__ = ["Checked", "ImageError", "Place", "Program", "Wrong"]
