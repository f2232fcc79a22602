"""How a line gets to a DCB-274 and its answer back: single mode, party line, daisy chain, SIN-10 (pages 15 to 28).

The unit's UART holds one character (page 25): the next one may go out only when the last was echoed. The manual
demands that of hosts on party lines and daisy chains; in single mode it demands no handshake, because it wants no
host there (page 22), but the UART is the same, so the same is done. An echo that is wrong or missing is found
before the line is complete: the line is taken back and entered again, so nobody carries out half of it.
"""

from typing import Final

from detent.hosts.errors import NoAnswer, Refused, Spoken
from detent.hosts.exchange import Ask, Clear, Driver, Pause, Steps, attempt, length

BS, LF, CR, SPACE, ESC = b"\x08", b"\n", b"\r", b" ", b"\x1b"
CTRL_C, CTRL_N, CTRL_P = b"\x03", b"\x0e", b"\x10"
SINGLE_LONGEST: Final = 15  # characters of a line (page 22)
NAMED_LONGEST: Final = 12  # behind the name (page 25)
TRIES: Final = 3  # to enter a line
STORED: Final = 0.5  # seconds in which the end of a program is written
RESTART: Final = 0.1  # seconds that a unit may take from ^C or ^P until it listens

RESET: Final = "was switched off and on, or reset: it is at 0, with the settings of its NV memory"


IN_PROGRAM_MODE: Final = "is in program mode, where lines are stored: P ends it, and so does ESC"


class NotListening(NoAnswer):
    """Not even the first character is echoed: a program runs, a command waits, the axis jogs, or nobody is there."""


class NotKnown(Refused):
    """An adapter knows no such axis: that is its own answer."""


class Handshake(Driver):
    """One way to bring lines to one unit. `patience`: seconds for an echo. `running`: a program is known to run.

    `longest` is how many characters fit into a line, behind the name where there is one. `programming`: the unit was
    found storing what it is sent, as somebody has begun a program (page 47).
    """

    longest: int = SINGLE_LONGEST

    def __init__(self, name: str, patience: float) -> None:
        self.name, self.patience = name, patience
        self.running = self.programming = False
        self.title = f"DCB-274 {name}".rstrip()

    def connect(self) -> Steps[str]:
        """See that the unit is there and ready for a line; its version if it tells. Nothing moves."""
        raise NotImplementedError
        yield

    def line(self, text: str, seconds: float, tries: int = TRIES) -> Steps[str]:
        """Enter a line, in so many `tries`; its result, which may take so many `seconds` beside the patience.

        Raises NotListening (nothing was begun), Refused, NoAnswer, BadAnswer.
        """
        raise NotImplementedError
        yield

    def spell(self, text: bytes) -> Steps[tuple[bytes, bool]]:
        """Send characters, each behind the echo of the one before; what was echoed, and whether that was all of it."""
        echo = b""
        for character in text:
            answer = yield Ask(bytes((character,)), length(1), self.patience)
            echo += answer.data
            if answer.data != bytes((character,)):
                return echo, False
        return echo, True

    def interrupt(self, character: bytes, *, known: bool) -> Steps[None]:
        """Send ``@`` or ``|``, where lines have names: also a unit that runs a program takes it (page 28).

        For the unit that runs nothing it is a line like any other, and means the same. It is on the line before
        anything is waited for that may not come. `known`: no part of another line stands before it, and lines are not
        stored; otherwise it is seen behind it whether they are, and then program mode is ended and it is sent again.
        """
        raise NotImplementedError
        yield

    def over(self) -> Steps[bool]:
        """Whether a program that was started has ended: only then is a line taken."""
        raise NotImplementedError
        yield

    def escape(self) -> Steps[None]:
        """ESC: every axis on the line stops at once and ends its program (page 33). It answers ``#``."""
        raise NotImplementedError
        yield

    def takes_lines(self) -> Steps[str]:
        """What X says. In program mode it is refused, and not stored as other looks are: raises Refused then.

        Raises NotKnown, NoAnswer, BadAnswer as well.
        """
        self.programming = False
        try:
            return (yield from self.line("X", 0.0))
        except NotKnown:
            raise
        except Refused as error:
            self.programming = True
            raise Refused(self.title, IN_PROGRAM_MODE, error.spoken, "#", 'command("P") sends P') from None

    def stores_lines(self) -> Steps[bool]:
        """Whether X is refused, and again: the first may have stood behind something. P where none are begins that."""
        for _ in range(2):
            told = yield from attempt(self.line("X", 0.0))
            if not isinstance(told, Refused) or isinstance(told, NotKnown):
                return False
        return True

    def end_program_mode(self) -> Steps[bool]:
        """P, if lines are stored (page 47); whether they were. An empty line is taken."""
        stores = yield from self.stores_lines()
        if stores:
            yield from attempt(self.line("P", STORED))
        self.programming = False
        return stores

    def restart(self, character: bytes) -> Steps[None]:
        """^C or ^P: every axis on the line is reset."""
        yield Ask(character)
        yield Pause(RESTART)
        yield Clear()

    def signs_on(self) -> Steps[bool]:
        """Whether a unit that takes no line waits for its sign-on, and has done it now: it was reset."""
        return False
        yield

    def refused(self, text: str, spoken: Spoken) -> Refused:
        """The error for a line that was answered ``#``."""
        return Refused(self.title, f"refuses {text!r}: {meaning(text)}", spoken, "#")


_MEANINGS: Final = {
    "l": "of the flags 2, 4 and 16 only one at a time (pages 45 and 46)",
    "Q": "programs are listed in single mode only (page 48)",
    "G": "programs stand at 0 to 192 and 256 to 2047; 2048 branches on the ports (page 38)",
    "P": "programs stand at 0 to 192 and 256 to 2047 (page 47)",
    "J": "it works in programs only",
    "L": "it works in programs only",
    "k": "it works in programs only",
    "i": "it works in programs only",
    "@": "the command that waited was given up",
}


def meaning(text: str) -> str:
    """What a ``#`` behind this line most likely means. The unit gives no reasons."""
    likely = _MEANINGS.get(text.lstrip()[:1])
    return likely or "a number out of range or missing, a command that this firmware has not, or program mode"
