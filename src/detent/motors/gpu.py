"""Whether variants are judged on a GPU (`gpu_threads`).

It is used only where `use` says so: a GPU may fuse a multiplication with an addition, and so give other last bits than
a processor; a variant at the very edge of a loss may then get another verdict.
"""

from enum import Enum

from detent.extras import MissingExtra, installed
from detent.motors import engine
from detent.motors.motor import MotorError

LEAST = 256  # variants: fewer are sooner done by a processor


class _Use(Enum):
    NEVER = "never"
    IF_IT_WORKS = "if it works"
    ALWAYS = "always"


_wanted = [_Use.NEVER]
_judged = [False]  # whether one has judged variants


def use(wanted: bool = True, *, where_there_is_one: bool = False) -> None:
    """Judge many variants on the GPU from now on, or no more; `where_there_is_one`: only if it is there, and works.

    MotorError, with the remedy, where there is none and that is not said.
    """
    _judged[0] = False
    there = wanted and available()
    if wanted and not there and not where_there_is_one:
        if not installed("fast"):
            raise MotorError(str(MissingExtra("fast", "work on a GPU needs")))
        raise MotorError(
            "there is no GPU here that numba sees: it needs a driver of NVIDIA's, and numba-cuda[cu12] or [cu13] with "
            "CUDA 12 or 13 beside numba"
        )
    _wanted[0] = _Use.NEVER if not there else _Use.IF_IT_WORKS if where_there_is_one else _Use.ALWAYS


def chosen(count: int) -> bool:
    """Whether so many variants go to the GPU."""
    return _wanted[0] is not _Use.NEVER and count >= LEAST


def worked() -> None:
    """It has judged variants."""
    _judged[0] = True


def failed() -> bool:
    """It does not work; whether that is no matter, as nobody has asked for it. It is not used again."""
    no_matter = _wanted[0] is _Use.IF_IT_WORKS
    _wanted[0] = _Use.NEVER
    return no_matter


def used() -> bool:
    """Whether a GPU has judged variants since `use`."""
    return _judged[0]


def available() -> bool:
    """Whether numba sees a GPU, or plays one (NUMBA_ENABLE_CUDASIM=1)."""
    if not engine.fast():
        return False
    try:
        from detent.motors import gpu_threads

        return gpu_threads.there()
    except Exception:  # a driver that is half there: whatever it raises, there is no GPU
        return False
