"""The kernels compiled, if numba is there; as plain Python, if not.

Without numba everything works and gives the same numbers, some hundred times slower: a long job is then refused with
the remedy instead of looking dead (`check_size`).
"""

from collections.abc import Callable
from functools import cache
from typing import Any

from detent.extras import how_to_install
from detent.motors import kernel
from detent.motors.motor import MotorError

MOST_PLAIN_SUBSTEPS = 3_000_000  # of plain Python: about half a minute

Kernel = Callable[..., Any]


class TooLong(MotorError):
    """Too much for plain Python: numba is missing."""


@cache
def compiler() -> Any:
    """The module numba, or None where it is not installed."""
    try:
        import numba
    except ImportError:
        return None
    return numba


def fast() -> bool:
    """Whether kernels are compiled."""
    return compiler() is not None


@cache
def compiled(function: Kernel, **options: Any) -> Kernel:
    """The function, compiled and kept on disk; itself without numba."""
    numba = compiler()
    if numba is None:
        return function
    made: Kernel = numba.njit(cache=True, error_model="numpy", **options)(function)
    return made


def advance() -> Kernel:
    """`kernel.advance`, as fast as it is to be had."""
    return compiled(kernel.advance)


def check_size(substeps: float, what: str) -> None:
    """Raise TooLong if plain Python would be at it for minutes."""
    if not fast() and substeps > MOST_PLAIN_SUBSTEPS:
        remedy = how_to_install("fast")
        raise TooLong(f"{what} takes {substeps:.2g} substeps, minutes without numba: ask for less, or {remedy}")
