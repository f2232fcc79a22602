"""What a DCB-274 answers, as values (page numbers as in the manual)."""

import re
from typing import Final, NamedTuple


class Settings(NamedTuple):
    """What X prints in single mode (pages 22 and 52): the working values. Speeds are steps/s before division by D.

    `decay`, `slow_decay` and `options` are None where the firmware is older and does not print them.
    """

    up: int  # K: steps at each speed of the ramp
    down: int
    initial: int  # I
    slew: int  # V
    divide: int  # D
    resolution: str  # H: 1/8, 1/4, 1/2, Full, Wave
    name: str
    decay: int | None = None  # b
    slow_decay: bool | None = None  # now
    options: int = 0  # l

    @classmethod
    def parse(cls, text: str) -> "Settings":
        """Read the line behind the echo of X. Raises ValueError."""
        match = _SETTINGS.search(text)
        if match is None:
            raise ValueError(f"{text!r} is no line of settings")
        found = match.groupdict()
        return cls(
            int(found["up"]), int(found["down"]), int(found["initial"]), int(found["slew"]), int(found["divide"]),
            found["resolution"].strip(), found["name"],
            None if found["decay"] is None else int(found["decay"]),
            None if found["slow"] is None else found["slow"] == "s",
            int(found["options"] or 0),
        )  # fmt: skip


_SETTINGS = re.compile(
    r"K= *(?P<up>\d+)/(?P<down>\d+), *I= *(?P<initial>\d+), *V= *(?P<slew>\d+), *D= *(?P<divide>\d+),"
    r"( *b= *(?P<decay>\d+),)?( *(?P<slow>[sf]),)?(?P<resolution>[^,=]+),( *l= *(?P<options>\d+),)? *n=(?P<name>.)"
)


MOVING: Final = {0: "at rest", 1: "indexing or homing", 3: "constant speed or jogging"}
"""What ^ answers (page 56)."""


class Ports(NamedTuple):
    """What A 129 answers (page 35): a port is true where its flag is set. P4 counts as an output, too."""

    p1: bool
    p2: bool
    p3: bool
    p4: bool

    @classmethod
    def of(cls, value: int) -> "Ports":
        """From the flags 1, 2, 4 and 8."""
        return cls(bool(value & 1), bool(value & 2), bool(value & 4), bool(value & 8))


class Inputs(NamedTuple):
    """What ] 0 answers (page 54): true where a switch is active."""

    limit_b: bool  # stops motion in minus direction
    limit_a: bool  # stops motion in plus direction
    home: bool
    p5: bool
    p4: bool
    p3: bool
    p2: bool
    p1: bool

    @classmethod
    def of(cls, value: int) -> "Inputs":
        """From the flags 128 to 1."""
        return cls(*(bool(value >> bit & 1) for bit in range(7, -1, -1)))


class JogInputs(NamedTuple):
    """What ] 1 answers (page 54): true where an input is active."""

    fast: bool  # JOG-S
    minus: bool  # JOG2
    plus: bool  # JOG1

    @classmethod
    def of(cls, value: int) -> "JogInputs":
        """From the flags 128, 64 and 32."""
        return cls(bool(value & 128), bool(value & 64), bool(value & 32))


class Listed(NamedTuple):
    """An instruction as Q lists it (page 48)."""

    address: int
    text: str

    def __str__(self) -> str:
        """As the unit prints it."""
        return f"{self.address} {self.text}"


class Listing(NamedTuple):
    """A program: its instructions, and the address of its end mark."""

    lines: tuple[Listed, ...]
    end: int

    @classmethod
    def parse(cls, lines: list[str]) -> "Listing":
        """Read the lines of Q; the last one is the bare end address. Raises ValueError."""
        listed = []
        for line in lines[:-1]:
            address, _, text = line.partition(" ")
            listed.append(Listed(int(address), text.strip()))
        return cls(tuple(listed), int(lines[-1]))
