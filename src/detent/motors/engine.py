"""The kernels compiled, if numba is there; as plain Python, if not.

Without numba everything works and gives the same numbers, some hundred times slower: a long job is then refused with
the remedy instead of looking dead (`check_size`). To tune is always one.
"""

from functools import cache

from detent.compiled import Function, compiler, jit
from detent.extras import how_to_install
from detent.motors import kernel
from detent.motors.motor import MotorError

MOST_PLAIN_SUBSTEPS = 3_000_000  # of plain Python: about half a minute


class TooLong(MotorError):
    """Too much for plain Python: numba is missing."""


def fast() -> bool:
    """Whether kernels are compiled."""
    return compiler() is not None


@cache
def compiled(function: Function) -> Function:
    """The function, compiled and kept on disk; itself without numba."""
    return jit(function)


def advance() -> Function:
    """`kernel.advance`, as fast as it is to be had."""
    return compiled(kernel.advance)


def check_size(substeps: float, what: str) -> None:
    """Raise TooLong if plain Python would be at it for minutes."""
    if not fast() and substeps > MOST_PLAIN_SUBSTEPS:
        remedy = how_to_install("fast")
        raise TooLong(f"{what} takes {substeps:.2g} substeps, minutes without numba: ask for less, or {remedy}")
