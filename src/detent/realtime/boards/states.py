"""How a driven cell stands, and what happened to it, for those who look: services, logs, pages."""

from enum import Enum
from typing import NamedTuple

from detent.ticks import Ns


class Standing(Enum):
    """Whether an axis is driven."""

    WAITING = "waiting"  # for its board
    DRIVEN = "driven"
    FAULT = "fault"  # it does not move until somebody says `recover`


class AxisState(NamedTuple):
    """How a driven axis stands."""

    unit: str
    axis: str
    board: str
    standing: Standing
    why: str  # it is at fault
    shaft: int  # where the cell has it
    known: bool  # whether the firmware's count is known to agree, as far as it can be told
    moving: bool
    lead: Ns
    lag: Ns  # beyond the lead
    slips: int
    slipped: Ns
    stops: int  # in the firmware, so far
    armed: tuple[str, ...]  # inputs that would stop it now


class BoardState(NamedTuple):
    """How a board stands."""

    board: str
    state: str
    firmware: str
    frequency: int
    move_count: int


class Severity(Enum):
    """How much it matters to whoever looks after the machine."""

    NOTE = "note"
    WARNING = "warning"
    FAULT = "fault"


class News(NamedTuple):
    """Something that people are told once, in one line."""

    at: Ns  # cell time
    severity: Severity
    text: str
