"""Whether variants are judged on a GPU (`gpu_threads`).

It is used only when it is asked for (`use`): a GPU may fuse a multiplication with an addition, and so give other last
bits than a processor; a variant at the very edge of a loss may then get another verdict.
"""

from detent.motors import engine
from detent.motors.motor import MotorError

LEAST = 256  # variants: fewer are sooner done by a processor

_wanted = [False]


def use(wanted: bool = True) -> None:
    """Judge many variants on the GPU from now on, or no more. MotorError, with the remedy, where there is none."""
    if wanted and not available():
        raise MotorError(
            "there is no GPU here that numba sees: it needs a driver of NVIDIA's, and numba-cuda[cu12] or [cu13] with "
            "CUDA 12 or 13 beside numba"
        )
    _wanted[0] = wanted


def chosen(count: int) -> bool:
    """Whether so many variants go to the GPU."""
    return _wanted[0] and count >= LEAST


def available() -> bool:
    """Whether numba sees a GPU, or plays one (NUMBA_ENABLE_CUDASIM=1)."""
    if not engine.fast():
        return False
    try:
        from detent.motors import gpu_threads

        return gpu_threads.there()
    except Exception:  # a driver that is half there: whatever it raises, there is no GPU
        return False
