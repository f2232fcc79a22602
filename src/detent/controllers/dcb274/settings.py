"""The working registers, and where they lie in NV memory (page 31).

(E) Cells that the manual does not give: the vector of T at 224, b and w at 225 and 226, Y at 248 and 249, the mode
of Z at 250. A register that NV memory holds out of its range is limited to it; a name that is none is A.
"""

from collections.abc import Mapping
from typing import Final

from detent.controllers.dcb274.link import FACTORY_NAME, is_name
from detent.controllers.dcb274.memory import Memory
from detent.ramps.timer_table import LEAST_COUNT, SLOWEST, TABLE, Speeds, count_of, rate_of

INVERT_LIMITS: Final = 1
STEP_OUT: Final = 2
MOVING_OUT: Final = 4
PLC: Final = 8
P4_INPUT: Final = 16
GENTLE: Final = 32
READ_BACK: Final = 128
CONFLICTS: Final = (STEP_OUT | MOVING_OUT, STEP_OUT | P4_INPUT, MOVING_OUT | P4_INPUT)  # pages 45 and 46

RESOLUTION: Final = (8, 4, 2, 1, 2, 1)  # steps to a full step, by H
RESOLUTION_NAMES: Final = ("1/8", "1/4", "1/2", "Full", "1/2", "Wave")
SPECIAL: Final = 0xFF  # in the cell of T's vector: the special trip of k is armed

_VECTOR, _DECAY, _PRE_ENERGIZE, _OPTIONS, _DIVIDE = 224, 225, 226, 227, 229
_INITIAL, _SLEW, _JOG, _RAMP, _TRIP, _TRIP_DATA = 230, 234, 238, 240, 242, 245
_RESOLUTION, NAME, _CURRENT, READOUT = 246, 247, 248, 250
_LARGEST_COUNT: Final = count_of(SLOWEST)


def conflict(flags: int) -> bool:
    """Whether these options of `l` exclude each other."""
    return any(flags & pair == pair for pair in CONFLICTS)


class Settings:
    """What I V D K B b H l w Y Z T k and the name have set."""

    __slots__ = ("current", "decay", "divide", "initial", "jog", "name", "options", "plc_for_now", "pre_energize",
                 "ramp", "readout", "resolution", "slew", "trip", "trip_data", "trip_vector")  # fmt: skip

    def __init__(self, name: str) -> None:
        """The factory values (page 32)."""
        self.initial, self.slew = count_of(800), count_of(10_000)
        self.divide = 1
        self.ramp = (5, 5)  # K up, down
        self.jog = (3, 20)  # times 30: "90/600"
        self.decay = 30
        self.resolution = 1
        self.options = 0
        self.plc_for_now = False  # flag 8 for this run, after a GO-SS conflict
        self.pre_energize = 0
        self.current = (25, 50)  # hold, run: percent of 4 A
        self.readout = 0  # Z 1
        self.trip, self.trip_data, self.trip_vector = 0, 0, 0
        self.name = ord(name)

    @property
    def flags(self) -> int:
        """The option flags in force."""
        return self.options | PLC if self.plc_for_now else self.options

    @property
    def speeds(self) -> Speeds:
        """What shapes a motion."""
        return Speeds(self.initial, self.slew, *self.ramp, self.divide)

    def cells(self) -> dict[int, int]:
        """What S writes, shadow RAM apart."""
        position = (self.trip & 0xFFFFFF).to_bytes(3, "little")
        initial, slew = self.initial.to_bytes(2, "little"), self.slew.to_bytes(2, "little")
        return {
            _VECTOR: self.trip_vector, _DECAY: self.decay, _PRE_ENERGIZE: self.pre_energize,
            _OPTIONS: self.options, _DIVIDE: self.divide,
            _INITIAL: initial[0], _INITIAL + 1: initial[1], **_pointer(_INITIAL + 2, self.initial),
            _SLEW: slew[0], _SLEW + 1: slew[1], **_pointer(_SLEW + 2, self.slew),
            _JOG: self.jog[0], _JOG + 1: self.jog[1], _RAMP: self.ramp[0], _RAMP + 1: self.ramp[1],
            **{_TRIP + i: value for i, value in enumerate(position)}, _TRIP_DATA: self.trip_data,
            _RESOLUTION: self.resolution, NAME: self.name,
            _CURRENT: self.current[0], _CURRENT + 1: self.current[1], READOUT: self.readout,
        }  # fmt: skip

    def registers(self) -> dict[str, str]:
        """The registers by the letters of their commands, as X has them."""
        up, down = self.ramp
        return {
            "I": str(rate_of(self.initial)), "V": str(rate_of(self.slew)), "K": f"{up}/{down}", "D": str(self.divide),
            "H": RESOLUTION_NAMES[self.resolution], "b": str(self.decay), "l": str(self.flags),
            "T": str(self.trip), "Y": f"{self.current[0]}/{self.current[1]} %", "n": chr(self.name),
        }  # fmt: skip

    def load(self, memory: Memory) -> None:
        """Reset and C: the registers as NV memory has them."""
        nv = memory.nv
        self.initial = _limited(int.from_bytes(nv[_INITIAL : _INITIAL + 2], "little"), LEAST_COUNT, _LARGEST_COUNT)
        self.slew = _limited(int.from_bytes(nv[_SLEW : _SLEW + 2], "little"), LEAST_COUNT, _LARGEST_COUNT)
        self.divide = max(nv[_DIVIDE], 1)
        self.ramp = nv[_RAMP], nv[_RAMP + 1]
        self.jog = nv[_JOG], nv[_JOG + 1]
        self.decay, self.pre_energize = nv[_DECAY], nv[_PRE_ENERGIZE]
        self.options = 0 if conflict(nv[_OPTIONS]) else nv[_OPTIONS] & ~READ_BACK
        self.plc_for_now = False
        self.resolution = min(nv[_RESOLUTION], len(RESOLUTION) - 1)
        self.current = min(nv[_CURRENT], 100), min(nv[_CURRENT + 1], 100)
        self.readout = nv[READOUT] & 1
        self.trip = int.from_bytes(nv[_TRIP : _TRIP + 3], "little", signed=True)
        self.trip_data = nv[_TRIP_DATA]
        vector = nv[_VECTOR]
        self.trip_vector = vector if vector <= 192 or vector == SPECIAL else 0
        self.name = nv[NAME] if is_name(nv[NAME]) else FACTORY_NAME

    def shown(self, slow: bool) -> str:
        """The line of X behind its echo (page 22)."""
        up, down = self.ramp
        special = f"l={self.flags}, " if self.flags else ""
        return (
            f" K= {up}/{down}, I= {rate_of(self.initial)}, V= {rate_of(self.slew)}, D= {self.divide}, b={self.decay}, "
            f"{'s' if slow else 'f'}, {RESOLUTION_NAMES[self.resolution]}, {special}n={chr(self.name)}"
        )


def factory(name: str = chr(FACTORY_NAME)) -> Mapping[int, int]:
    """The parameter cells as they leave the factory; C 1 writes those below 247."""
    return Settings(name).cells()


def _pointer(address: int, count: int) -> dict[int, int]:
    """Where the ramp table passes a speed: the entries slower than it, in two cells."""
    entry = sum(slower > count for slower in TABLE).to_bytes(2, "little")
    return {address: entry[0], address + 1: entry[1]}


def _limited(value: int, low: int, high: int) -> int:
    return min(max(value, low), high)
