"""Functions compiled by numba, their machine code kept on disk; without numba, the functions themselves."""

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from typing import Any

Function = Callable[..., Any]

KNOWN = ("0.68.",)  # versions of numba whose machine code runs without what else numba loads


@cache
def compiler() -> Any:
    """The module numba, or None where it is not installed."""
    try:
        import numba
    except ImportError:
        return None
    return numba


def jit(function: Function, **options: Any) -> Function:
    """The function compiled at its first call; itself without numba. `options` are those of numba.

    Machine code that is on disk is taken from there. Where none can be kept (a folder that is read only, a user
    without a home, a full disk), or what is kept is broken, it is compiled anew.
    """
    numba = compiler()
    if numba is None:
        return function
    try:
        made: Any = numba.njit(cache=True, error_model="numpy", **options)(function)
    except RuntimeError:  # numba finds no folder to write to
        return numba.njit(error_model="numpy", **options)(function)  # type: ignore[no-any-return]
    kept = _kept()
    if kept is not None and isinstance(getattr(made, "_cache", None), kept.__base__):
        made._cache = kept(function)  # noqa: SLF001 (numba has no other way)
    return made  # type: ignore[no-any-return]


@cache
def _kept() -> Any:
    """The class of numba's cache on disk, quicker, and not stopped by what is broken; None where numba has none."""
    try:
        from numba.core import caching, runtime
    except ImportError:
        return None
    base: Any = caching.FunctionCache
    helpers: Any = runtime  # that machine code calls
    quick = compiler().__version__.startswith(KNOWN)

    class Kept(base):  # type: ignore[misc]
        """A cache that looks on disk first.

        Before it looks, numba fills all its tables of types and operations, which takes as long as to judge a move.
        They are for compiling: what machine code calls when it runs is there without them.
        """

        def load_overload(self, sig: Any, target_context: Any) -> Any:
            found = None
            try:
                if not quick:
                    return super().load_overload(sig, target_context)
                helpers.rtsys.initialize(target_context)
                found = self._load_overload(sig, target_context)
            except Exception:  # a file cut short, or of others: whatever a pickle raises that is none
                with suppress(OSError):
                    self.flush()
            if found is None:
                target_context.refresh()
            return found

        def save_overload(self, sig: Any, data: Any) -> None:
            with suppress(OSError):
                super().save_overload(sig, data)

    return Kept
