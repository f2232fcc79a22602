"""What goes wrong between a host and a device, whoever is at fault.

- ``ValueError``: the caller; a number out of range, a call that this unit does not know
- ``DriverError``: the device or the line; carries the exchange

  - ``NoAnswer`` (a TimeoutError): nothing, or not all of an answer, came in time
  - ``BadAnswer``: something came that the manual does not know here, or that was damaged
  - ``Refused``: the device understood and said no; ``Busy``: because it is doing something else
  - ``MotionFailed``: a motion ended otherwise than it was asked to: a limit, a stop, an overflow
  - ``PortLost`` (a ConnectionError): the port went away; the next call opens it again
"""

from typing import NamedTuple


class Spoken(NamedTuple):
    """What was sent and what came back, as it was on the wire."""

    sent: bytes
    received: bytes

    def __str__(self) -> str:
        """Both as people read bytes: printable ones as they are, the rest escaped."""
        return f"sent {_shown(self.sent)}, received {_shown(self.received) if self.received else 'nothing'}"


class DriverError(RuntimeError):
    """A device or a line does not do what its manual says. `spoken` is the exchange, if there was one."""

    def __init__(self, unit: str, what: str, spoken: Spoken | None = None) -> None:
        super().__init__(f"{unit}: {what}" + (f" ({spoken})" if spoken is not None else ""))
        self.unit, self.what, self.spoken = unit, what, spoken


class NoAnswer(DriverError, TimeoutError):
    """Nothing, or not all of an answer, came in time."""


class BadAnswer(DriverError):
    """An answer that cannot be understood, or that was damaged on the way."""


class Refused(DriverError):
    """The device says no. `code` is what it answered, as the manual names it: ``E2``, ``#``."""

    def __init__(self, unit: str, what: str, spoken: Spoken | None = None, code: str = "") -> None:
        super().__init__(unit, what, spoken)
        self.code = code


class Busy(Refused):
    """The device says no because it is doing something else."""


class MotionFailed(DriverError):
    """A motion that did not end where it should have."""


class PortLost(DriverError, ConnectionError):
    """The port went away."""


def _shown(data: bytes) -> str:
    return repr(data)[1:]
