"""Program source and the program memory of a unit that a driver talks to: both as instructions at addresses."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol, cast

from detent.assembler import Assembly, AssemblyFailed, Language, assemble, disassemble
from detent.hosts.exchange import Driver, Steps


class Programmed(Protocol):
    """A plain driver of a unit with program memory. `read_program` of one whose programs have places takes one."""

    @property
    def read_program(self) -> Callable[..., Steps[list[str]]]:
        """The instructions that are stored."""


def lines_of(assembly: Assembly[Any]) -> list[str]:
    """The commands as a driver takes them; where programs have places, with the address of each."""
    if _origin(assembly.language) is None:
        return list(assembly.commands)
    return [f"{placed.address} {placed.text}" for placed in assembly.placed]


def numbered_lines_of(assembly: Assembly[Any]) -> list[str]:
    """An instruction with its address a line, in their order: to be compared with `places_of`."""
    return [f"{placed.address:4} {placed.text}" for placed in sorted(assembly.placed)]


def source_of(language: Language[Any], lines: Sequence[str]) -> str:
    """Source with labels of what a driver has read; the lines as they are if this assembler cannot read them."""
    try:
        return disassemble(language, assemble(language, "\n".join(lines)).whole)
    except (AssemblyFailed, ValueError):
        return "".join(f"{line}\n" for line in lines)


def places_of(driver: Driver, assembly: Assembly[Any]) -> Steps[list[str]]:
    """What the unit holds in the places of a program, an instruction with its address a line. Raises DriverError."""
    language, unit = assembly.language, cast("Programmed", driver)
    origin = _origin(language)
    if origin is None:
        return _addressed(language, (yield from unit.read_program()))
    found: list[str] = []
    end = None
    for placed in sorted(assembly.placed):
        if placed.address != end:  # another program begins here
            lines = yield from unit.read_program(placed.address)
            found += _addressed(language, [origin(placed.address), *lines])
        end = placed.address + len(placed.code)
    return found


def _origin(language: Language[Any]) -> Callable[[int], str] | None:
    """How a language says where the next instruction stands, if its programs have places."""
    found: Callable[[int], str] | None = getattr(language, "origin", None)
    return found


def _addressed(language: Language[Any], lines: Sequence[str]) -> list[str]:
    try:
        placed = assemble(language, "\n".join(lines)).placed
    except AssemblyFailed:
        return list(lines)
    return [f"{each.address:4} {each.text}" for each in placed]
