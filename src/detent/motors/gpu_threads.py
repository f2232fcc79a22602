"""Variants on a GPU, a thread each: `kernel.advance` as it stands, by numba's CUDA target.

Imported only where a GPU is asked for. The kernel has `cuda` from its module, where the simulator looks for it.
"""

from typing import Any

import numpy as np
from numba import cuda as numba_cuda

from detent.motors import kernel
from detent.motors.motor import MotorError
from detent.motors.rotor import Floats

THREADS = 64  # of a block

cuda: Any = numba_cuda
step = cuda.jit(device=True)(kernel.advance)


def there() -> bool:
    """Whether numba sees a GPU."""
    return bool(cuda.is_available())


@cuda.jit
def threads(  # type: ignore[no-untyped-def]
    codes, s, n, times, places, levels, rows, modes, until, a, b, par, by_time, by_position, trace, substep
):
    """Each variant, a row of `s`, `n`, `par` and the profiles, through the changes to `until`; see `kernel.advance`."""
    k = cuda.grid(1)
    if k < s.shape[0]:
        codes[k] = step(
            s[k], n[k], times, places, levels, rows, modes, until, a, b, par[k], by_time[k], by_position[k],
            -1e300, 1e300, trace, substep,
        )  # fmt: skip


class Threads:
    """States of variants on the GPU; `advance` all of them through the same changes."""

    def __init__(
        self, s: Floats, n: Any, par: Floats, by_time: Floats, by_position: Floats, tables: tuple[Floats, Floats]
    ) -> None:
        """A row for each variant: `kernel`'s state in floats and integers, parameters, profiles of the load."""
        self._s, self._n = cuda.to_device(s), cuda.to_device(n)
        self._shared = [cuda.to_device(np.ascontiguousarray(one)) for one in (*tables, par, by_time, by_position)]
        self._trace = cuda.to_device(np.zeros((1, kernel.COLUMNS)))
        self._codes = cuda.to_device(np.zeros(len(s), np.int64))
        self._blocks = -(-len(s) // THREADS)

    def advance(self, changes: Any, until: int, substep: int) -> None:
        """Go on to `until`. MotorError for a rotor that runs away."""
        sent = [cuda.to_device(np.ascontiguousarray(one)) for one in changes]
        threads[self._blocks, THREADS](
            self._codes, self._s, self._n, *sent, until, *self._shared, self._trace, substep
        )  # fmt: skip
        if (self._codes.copy_to_host() == kernel.BROKEN).any():
            raise MotorError("a rotor runs away: a load that nothing holds; check torque and inertia of the load")

    def state(self) -> tuple[Floats, Any]:
        """Where they are now: floats and integers."""
        return self._s.copy_to_host(), self._n.copy_to_host()
