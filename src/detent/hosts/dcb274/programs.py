"""Which bytes of NV memory are programs, and which are left of older ones (pages 38, 39, 47 to 49 and 59).

An end mark ends a program, whatever stands behind it: a program that is stored over a longer one leaves the rest of
that one in memory, and nothing tells its bytes from a program's but where they stand. So what stands right behind an
end mark is left over, unless a jump of a program leads there. Nothing of it is lost: `read_program(address)` lists
whatever stands at an address.
"""

from collections.abc import Iterable, Mapping
from typing import Final

from detent.hosts.dcb274.answers import Listing
from detent.hosts.dcb274.ranges import LARGEST_ADDRESS

SIZE: Final = LARGEST_ADDRESS + 1
END: Final = 0xFF  # ends a program (page 47)
SHADOW: Final = range(128, 192)  # programs there run from RAM, which S copies to NV memory (page 32)
NO_PROGRAM: Final = range(193, 256)
POWER_UP: Final = 1600  # what stands there is executed at power-up
BRANCHES: Final = range(256, 512, 16)  # where G 2048 leads to, by the ports (page 39)
_BRANCH: Final = "2048"
_MOST_MARKS: Final = 4  # FFh in a row inside what is left over: an end mark and the three bytes of a number


def behind(memory: bytes, end: int) -> int:
    """The first address behind the end mark at `end` where another program may begin: past what is left over there."""
    at, edge = end, next(edge for edge in (SHADOW.start, NO_PROGRAM.stop, POWER_UP, SIZE, end + 1) if edge > end)
    most = 1  # end marks that belong together: the one at `end`, or those in what is left over
    while at < edge:
        marks = 0
        while at < edge and memory[at] == END:
            at, marks = at + 1, marks + 1
        if marks > most:
            return at
        while at < edge and at not in NO_PROGRAM and memory[at] != END:
            at += 1
        if at in NO_PROGRAM:
            return NO_PROGRAM.stop
        most = _MOST_MARKS
    return edge


def led_to(listings: Iterable[Listing]) -> set[int]:
    """Where the jumps, calls and trips of programs lead (pages 38, 41, 43 and 49)."""
    places: set[int] = set()
    for listing in listings:
        for line in listing.lines:
            letter, *numbers = line.text[0], *line.text[1:].replace(",", " ").split()
            if letter == "G" and numbers[:1] == [_BRANCH]:
                places.update(BRANCHES)
            elif letter in "GJL" and numbers:
                places.add(int(numbers[0]))
            elif letter == "T" and len(numbers) > 1:
                places.add(int(numbers[1]))
    return {place for place in places if place < SIZE and place not in NO_PROGRAM}


def holds(listings: Mapping[int, Listing], address: int) -> bool:
    """Whether `address` belongs to one of some programs, which begin where they are listed from."""
    return any(start <= address < listing.end for start, listing in listings.items())


def left_over(memory: bytes, listings: Mapping[int, Listing]) -> list[int]:
    """The addresses of program memory that hold something and belong to no program."""
    places = (at for at in range(SIZE) if at not in NO_PROGRAM and memory[at] != END)
    return [at for at in places if not holds(listings, at)]
