"""What goes wrong between a host and a device, whoever is at fault.

- ``ValueError``: the caller; a number out of range, a call that this unit does not know
- ``DriverError``: the device or the line; carries the exchange

  - ``NoAnswer`` (a TimeoutError): nothing, or not all of an answer, came in time
  - ``BadAnswer``: something came that the manual does not know here, or that was damaged
  - ``Refused``: the device understood and said no; ``Busy``: because it is doing something else
  - ``MotionFailed``: a motion ended otherwise than it was asked to: a limit, a stop, an overflow
  - ``PortLost`` (a ConnectionError): the port went away; the next call opens it again
"""

from typing import Final, NamedTuple

from detent.one_line import one_line


class Spoken(NamedTuple):
    """What was sent and what came back, as it was on the wire."""

    sent: bytes
    received: bytes

    def __str__(self) -> str:
        """Both as people read bytes: printable ones as they are, the rest escaped; of much only the ends."""
        return f"sent {_shown(self.sent)}, received {_shown(self.received) if self.received else 'nothing'}"

    @property
    def echoed(self) -> bool:
        """Whether what came is what was sent: a looped line, or an adapter that echoes."""
        return self.sent != b"" and self.received == self.sent


class DriverError(RuntimeError):
    """A device or a line does not do what its manual says. `spoken` is the exchange, if there was one.

    `advice` says which call helps; `told` is the error without it, for whoever does not call from Python. Whatever the
    device said, it is one line, and of much that `what` quotes the middle is left out.
    """

    def __init__(self, unit: str, what: str, spoken: Spoken | None = None, advice: str = "") -> None:
        what = one_line(what, LONGEST)
        exchange = f" ({spoken})" if spoken is not None else ""
        super().__init__(one_line(f"{unit}: {what}" + (f": {advice}" if advice else "") + exchange))
        self.unit, self.what, self.spoken, self.advice = unit, what, spoken, advice
        self.told = one_line(f"{unit}: {what}{exchange}")


def told(error: BaseException) -> str:
    """What went wrong, for whoever does not call from Python."""
    return error.told if isinstance(error, DriverError) else str(error)


class NoAnswer(DriverError, TimeoutError):
    """Nothing, or not all of an answer, came in time."""


class BadAnswer(DriverError):
    """An answer that cannot be understood, or that was damaged on the way."""


class Refused(DriverError):
    """The device says no. `code` is what it answered, as the manual names it: ``E2``, ``#``."""

    def __init__(self, unit: str, what: str, spoken: Spoken | None = None, code: str = "", advice: str = "") -> None:
        super().__init__(unit, what, spoken, advice)
        self.code = code


class Busy(Refused):
    """The device says no because it is doing something else."""


class MotionFailed(DriverError):
    """A motion that did not end where it should have."""


class PortLost(DriverError, ConnectionError):
    """The port went away."""


LONGEST: Final = 300  # characters of what went wrong: the exchange and the advice have room in the line, too

ECHOES: Final = "sends back what it is sent: the line is looped or crossed, or an adapter echoes; nobody answered"

SHOWN: Final = 120
"""How many bytes of an exchange an error shows; of more, the first and the last of them."""


def _shown(data: bytes) -> str:
    if len(data) <= SHOWN:
        return repr(data)[1:]
    return f"{repr(data[: SHOWN // 2])[1:]} ... {repr(data[-SHOWN // 4 :])[1:]}, {len(data)} bytes"
