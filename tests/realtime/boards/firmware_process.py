"""The stock firmware's Linux process, where there is one: its terminal, and the machine behind its pins.

`DETENT_FIRMWARE_PTY` is the terminal of a running firmware (its Linux process, or a board that may move nothing).
`DETENT_FIRMWARE_MACHINE` is the shared memory of a stand-in for its GPIO device which counts steps and moves switches:
64-bit number of records and room for them, 512 levels of inputs, 512 of outputs, 16 axes (int32 step, dir, inverted,
used, int64 position), 32 switches (int32 used, axis, line, level inside, int64 lowest, highest), then the records
(uint64 ns, uint16 line, uint16 level, int32 position). Position 15 of the axes is by how much its clock lags behind
the host's.
"""

import mmap
import os
import struct
import time
from pathlib import Path

import pytest

from detent.ticks import Ns

TERMINAL = os.environ.get("DETENT_FIRMWARE_PTY", "")
MACHINE = os.environ.get("DETENT_FIRMWARE_MACHINE", "")

with_firmware = pytest.mark.skipif(not TERMINAL, reason="DETENT_FIRMWARE_PTY does not name the terminal of a firmware")
with_machine = pytest.mark.skipif(
    not (TERMINAL and MACHINE), reason="DETENT_FIRMWARE_MACHINE does not name a machine behind the pins of a firmware"
)

INPUTS, AXES, SWITCHES, RECORDS = 16, 16 + 1024, 16 + 1024 + 16 * 24, 16 + 1024 + 16 * 24 + 32 * 32
STEP, DIR = 2, 3


class Machine:
    """The machine behind the pins; none: nothing is known but what the firmware says. Axis 0 is on `STEP` and `DIR`."""

    def __init__(self, path: str) -> None:
        self._memory: mmap.mmap | None = None
        if path:
            with Path(path).open("r+b") as file:
                self._memory = mmap.mmap(file.fileno(), 0)
            memory = self._memory
            memory[INPUTS : INPUTS + 512] = bytes([1]) * 512
            memory[AXES + 24 : AXES + 14 * 24] = bytes(13 * 24)
            memory[SWITCHES : SWITCHES + 32 * 32] = bytes(32 * 32)
            self.axis(0, STEP, DIR, position=self.position)

    @property
    def position(self) -> int:
        return self.position_of(0)

    def axis(self, number: int, step: int, dir: int, *, inverted: bool = False, position: int = 0) -> None:
        """An axis that moves up with each pulse while `dir` is high; the pulse is a low one if `inverted`."""
        assert self._memory is not None
        struct.pack_into("<iiiiq", self._memory, AXES + 24 * number, step, dir, inverted, 1, position)

    def position_of(self, axis: int) -> int:
        assert self._memory is not None
        return int(struct.unpack_from("<q", self._memory, AXES + 24 * axis + 16)[0])

    def switch(self, line: int, low: int, high: int, *, number: int = 0, axis: int = 0, inside: bool = False) -> None:
        """An input that has the level `inside` between two positions, the other one elsewhere."""
        assert self._memory is not None
        struct.pack_into("<iiiiqq", self._memory, SWITCHES + 32 * number, 1, axis, line, inside, low, high)
        self.put(line, (low <= self.position_of(axis) <= high) is inside)

    def put(self, line: int, level: bool) -> None:
        assert self._memory is not None
        self._memory[INPUTS + line] = int(level)

    def output(self, line: int) -> bool:
        assert self._memory is not None
        return bool(self._memory[INPUTS + 512 + line])

    def records(self) -> list[tuple[int, int, int, int]]:
        """(ns, line, level, position) so far."""
        assert self._memory is not None
        count = struct.unpack_from("<Q", self._memory, 0)[0]
        return list(struct.iter_unpack("<QHHi", self._memory[RECORDS : RECORDS + 16 * count]))

    def forget(self) -> None:
        """There are no records."""
        assert self._memory is not None
        struct.pack_into("<Q", self._memory, 0, 0)

    @property
    def behind(self) -> Ns:
        """By how much the firmware's clock lags behind the host's."""
        return 0 if self._memory is None else int(struct.unpack_from("<q", self._memory, AXES + 15 * 24 + 16)[0])

    def begins_anew(self) -> None:
        """The process starts again, and its clock with no lag; it tells that only when it lags again."""
        if self._memory is not None:
            struct.pack_into("<q", self._memory, AXES + 15 * 24 + 16, 0)

    def wall(self) -> Ns:
        """The clock that the firmware keeps."""
        return time.monotonic_ns() - self.behind
