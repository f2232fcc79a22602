"""The fields of a motor record that mean something here, by the names and numbers of EPICS.

Positions are known in three coordinates: raw in steps, dial = raw x MRES, user = dial x DIR + OFF.
"""

from dataclasses import dataclass
from decimal import Decimal
from enum import IntEnum, IntFlag
from typing import Final, NamedTuple, TypeAlias

Value: TypeAlias = int | float | str

USE, SET = 0, 1
VARIABLE, FROZEN = 0, 1
POSITIVE, NEGATIVE = 0, 1
ACCL, ACCS = 0, 1  # ACCU: which of the two stays when the velocity changes
MOST_PRECISION: Final = 9
LONGEST_WAY: Final = (1 << 31) - 1  # steps: raw positions of a motor record have 32 bits
LARGEST: Final = 1e100  # of any number that a client may put

MENUS: Final = {"DIR": 2, "SET": 2, "FOFF": 2, "SPMG": 4, "STUP": 3, "ACCU": 2, "RSTM": 4}
"""How many choices those fields have that are one of a list."""

RANGES: Final = {"PREC": (0, 15), "DLY": (0, 3600), "RDBD": (0, LARGEST), "JVEL": (0, LARGEST)}
"""What other fields may be."""


class Go(IntEnum):
    """SPMG: whether the record moves its motor."""

    STOP = 0
    PAUSE = 1
    MOVE = 2
    GO = 3


class Doing(IntFlag):
    """MIP: which motion is in progress."""

    NOTHING = 0
    JOG_FORWARD = 0x1
    JOG_REVERSE = 0x2
    HOME_FORWARD = 0x8
    HOME_REVERSE = 0x10
    MOVE = 0x20
    STOP = 0x200


class Status(IntFlag):
    """MSTA: the state of the motor."""

    PLUS = 0x1
    DONE = 0x2
    PLUS_LIMIT = 0x4
    PROBLEM = 0x200
    MOVING = 0x400
    NO_COMMUNICATION = 0x1000
    MINUS_LIMIT = 0x2000
    HOMED = 0x4000


class Alarm(NamedTuple):
    """STAT and SEVR, as EPICS names them."""

    status: str
    severity: str


NO_ALARM: Final = Alarm("NO_ALARM", "NO_ALARM")
COMMUNICATION: Final = Alarm("COMM", "INVALID_ALARM")
FAILED: Final = Alarm("STATE", "MAJOR_ALARM")
STOPPED: Final = Alarm("STATE", "MINOR_ALARM")


@dataclass(frozen=True)
class Settings:
    """How a record begins.

    `resolution` is MRES, units of `egu` a step, negative if the axis counts the other way. Limits are dial positions,
    both 0 are none. `base` and `velocity` are units/s (`most` the largest, 0: what the unit can), `acceleration`
    seconds. Raises ValueError.
    """

    resolution: float = 1.0
    egu: str = "steps"
    low: float = 0.0
    high: float = 0.0
    base: float = 100.0
    velocity: float = 500.0
    most: float = 0.0
    acceleration: float = 0.2
    description: str = ""

    def __post_init__(self) -> None:
        numbers = (self.resolution, self.low, self.high, self.base, self.velocity, self.most, self.acceleration)
        if not all(abs(number) <= LARGEST for number in numbers):
            raise ValueError(f"settings are numbers up to {LARGEST:g}, not {numbers}")
        if abs(self.resolution) < 1 / LARGEST:
            raise ValueError("a resolution of 0 is no resolution: say how far one step is, like 0.0025")
        if self.low > self.high:
            raise ValueError(f"the low limit {self.low:g} lies above the high limit {self.high:g}")
        if not 0 <= self.base <= self.velocity or not self.velocity > 0 or self.acceleration < 0:
            raise ValueError(
                f"moves begin at 0 or more, go no slower than they begin, and ramp for 0 s or more; "
                f"not {self.base:g} to {self.velocity:g} in {self.acceleration:g} s"
            )
        if self.most and self.most < self.velocity:
            raise ValueError(f"the velocity {self.velocity:g} is above the largest one, {self.most:g}")

    @property
    def precision(self) -> int:
        """Digits behind the point that a position of whole steps needs, 9 at most."""
        exponent = Decimal(repr(self.resolution)).normalize().as_tuple().exponent
        assert isinstance(exponent, int)
        return min(max(-exponent, 0), MOST_PRECISION)

    @property
    def raw_limits(self) -> tuple[float, float]:
        """RLLM and RHLM: the limits in steps."""
        low, high = sorted((self.low / self.resolution, self.high / self.resolution))
        return low, high

    def fields(self) -> dict[str, Value]:
        """What a record has from the beginning, before its motor was asked anything."""
        return {
            "DESC": self.description, "EGU": self.egu, "PREC": self.precision,
            "MRES": self.resolution, "RRES": self.resolution, "ERES": self.resolution,
            "SREV": 200, "UREV": 200 * abs(self.resolution),
            "VAL": 0.0, "DVAL": 0.0, "RVAL": 0, "RLV": 0.0,
            "RBV": 0.0, "DRBV": 0.0, "RRBV": 0, "RMP": 0, "REP": 0, "DIFF": 0.0, "RDIF": 0,
            "OFF": 0.0, "DIR": POSITIVE, "SET": USE, "FOFF": VARIABLE,
            "DHLM": self.high, "DLLM": self.low, "HLM": self.high, "LLM": self.low, "LVIO": 0,
            "RHLM": self.raw_limits[1], "RLLM": self.raw_limits[0],
            "HLS": 0, "LLS": 0, "RHLS": 0, "RLLS": 0,
            "VELO": self.velocity, "VBAS": self.base, "VMAX": self.most, "ACCL": self.acceleration,
            "ACCS": self.velocity / self.acceleration if self.acceleration else 0.0, "ACCU": ACCL,
            "JVEL": self.velocity, "TWV": abs(self.resolution), "RDBD": 0.0, "RTRY": 0, "DLY": 0.0,
            "DMOV": 1, "MOVN": 0, "MIP": int(Doing.NOTHING), "MISS": 0, "MSTA": int(Status.DONE), "TDIR": 1, "CDIR": 1,
            "ATHM": 0, "SPMG": int(Go.GO), "STOP": 0, "SYNC": 0, "STUP": 0, "RSTM": 2, "CBAK": 0,
            "HOMF": 0, "HOMR": 0, "JOGF": 0, "JOGR": 0, "TWF": 0, "TWR": 0, "SSET": 0, "SUSE": 0,
        }  # fmt: skip
