"""Detent: intelligent stepper motor controllers in software, exact to the pulse.

Start reading at ARCHITECTURE.md ("life of a move"); the packages below are listed there from the
command line down to the integer nanoseconds that everything stands on.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from detent.realtime.connect import connect, connect_async

__version__ = "0.2.0"
__all__ = ["__version__", "connect", "connect_async"]


def __getattr__(name: str) -> object:
    """Import `connect` and `connect_async` when they are first used: importing detent stays quick."""
    if name in ("connect", "connect_async"):
        from detent.realtime import connect as ways

        return getattr(ways, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """What is there, `connect` and `connect_async` before their first use, too."""
    return sorted(({*globals()} - {"TYPE_CHECKING"}) | {*__all__})
