"""The three ways to talk to the controller: single mode, party line, daisy chain (pages 15 to 28).

An entry takes characters one by one and says what is sent back and which command line is complete. What a single
character does at once (ESC, ^C, ^N, ^P) is the firmware's business, as is the @ of a line that is closed because
a program runs or a command waits. What may be the name of an axis is said here, once for all who ask.
"""

from enum import Enum
from typing import Final, NamedTuple, Protocol

BS, LF, CR, ESC, SPACE = 0x08, 0x0A, 0x0D, 0x1B, 0x20
CTRL_C, CTRL_N, CTRL_P = 0x03, 0x0E, 0x10
SINGLE_LONGEST: Final = 15  # characters (page 22)
NAMED_LONGEST: Final = 12  # behind the name (page 25)
NOT_NAMES: Final = frozenset(b"[\\]^_`@") | {CTRL_C, CR, LF}  # "non-valid names" (page 23)
FIRST_PRINTABLE, LAST_PRINTABLE = 0x20, 0x7E
NO_NAME: Final = 0  # (E) no axis has the name NUL: it stands for none, as behind `|` in a program
FACTORY_NAME: Final = ord("A")  # "usually A" (page 5)


class Mode(Enum):
    """How the controller listens."""

    WAITING = "waiting for sign-on"
    SINGLE = "single mode"
    PARTY = "party line"
    DAISY = "daisy chain"

    @property
    def named(self) -> bool:
        """Whether lines begin with the name of an axis."""
        return self in (Mode.PARTY, Mode.DAISY)


def is_name(value: int) -> bool:
    """Whether a character may be a name: any, "including control characters" (page 23), but those of the list.

    SPACE signs on, the single-character commands are what they are, and NUL is `NO_NAME`.
    """
    return NO_NAME < value <= LAST_PRINTABLE and value not in NOT_NAMES and value not in (SPACE, ESC, CTRL_N, CTRL_P)


def next_name(value: int) -> int:
    """The next valid name in ASCII order."""
    value += 1
    while value <= LAST_PRINTABLE and not is_name(value):
        value += 1
    return value if value <= LAST_PRINTABLE else FIRST_PRINTABLE + 1


class Entered(NamedTuple):
    """What one character brings.

    `reply` goes back at once, before whatever the character does; `line` is complete if it is not None; `too_long`
    says that more was typed than fits; `interrupt` is a single-character command for this axis.
    """

    reply: bytes = b""
    line: str | None = None
    too_long: bool = False
    interrupt: int = 0


NOTHING: Final = Entered()


class Entry(Protocol):
    """A command line in the making."""

    @property
    def empty(self) -> bool:
        """Whether no command has begun."""

    def skips(self, value: int) -> bool:
        """Take a character that means nothing to this axis; False, and it is not taken, if it may mean something."""

    @property
    def turned_away(self) -> int | None:
        """The name that it skips all lines up to, while one for others is under way; None: this one may be for it."""

    def feed(self, value: int) -> Entered:
        """Take one character."""

    def feed_closed(self, value: int) -> Entered:
        """Take one character while no line is accepted: only interrupts count."""

    def clear(self) -> None:
        """Forget what was typed."""


class SingleEntry:
    """The line editor of single mode: every character is echoed as it comes, CR and LF are not; BS edits."""

    __slots__ = ("_text", "_too_long")

    def __init__(self) -> None:
        self._text = bytearray()
        self._too_long = False

    @property
    def empty(self) -> bool:
        """Whether no command has begun."""
        return not self._text

    def skips(self, value: int) -> bool:
        """None: every character may mean something."""
        return False

    @property
    def turned_away(self) -> int | None:
        """Never: every line is for it."""
        return None

    def feed(self, value: int) -> Entered:
        """Take one character."""
        if value == CR:
            line, too_long = self._text.decode("latin-1"), self._too_long
            self.clear()
            return Entered(line=line, too_long=too_long)
        if value == BS:
            if not self._text:
                return NOTHING
            del self._text[-1]
            self._too_long = False
            return Entered(bytes((BS,)))
        if not FIRST_PRINTABLE <= value <= LAST_PRINTABLE:
            return NOTHING
        if len(self._text) == SINGLE_LONGEST:
            self._too_long = True
            return NOTHING
        self._text.append(value)
        return Entered(bytes((value,)))

    def feed_closed(self, value: int) -> Entered:
        """Only @ counts; nothing is echoed."""
        return Entered(interrupt=value) if value == ord("@") else NOTHING

    def clear(self) -> None:
        """Forget what was typed."""
        self._text.clear()
        self._too_long = False


AT_ONCE: Final = frozenset((ESC, CTRL_C, CTRL_N, CTRL_P))


class _Place(Enum):
    """Where a line of several axes is."""

    START = "at its start"
    MINE = "a line for this axis"
    OTHERS = "a line for somebody else, or one that is not taken"
    TAKEN = "a closed line that was an interrupt"


_START: Final = _Place.START
_OTHERS: Final = _Place.OTHERS


class NamedEntry:
    """Lines that begin with a name: LF, name, up to 12 characters, LF. Only the named axis answers.

    The name is echoed at once, whatever the axis is about: a host waits for each echo (page 25) before it sends the
    next character, be it the ``|`` or ``@`` that ends a program. A line that is closed echoes nothing else.
    On a daisy chain every axis passes on what is not for it, and what is for it as its echo.
    """

    __slots__ = ("_passes", "_place", "_text", "_too_long", "name")

    def __init__(self, name: int, *, passes: bool) -> None:
        self.name = name
        self._passes = passes
        self._place = _Place.START
        self._text = bytearray()
        self._too_long = False

    @property
    def empty(self) -> bool:
        """Whether no command for this axis has begun."""
        return self._place is not _Place.MINE

    def feed(self, value: int) -> Entered:
        """Take one character."""
        if self._place is _Place.START:
            return self._begin(value)
        if self._place is _Place.TAKEN:
            return self._taken(value)
        if self._place is not _Place.MINE:
            return self._foreign(value)
        if value == LF:
            line, too_long = self._text.decode("latin-1"), self._too_long
            self.clear()
            return Entered(line=line, too_long=too_long)
        if len(self._text) == NAMED_LONGEST:
            self._too_long = True
            return NOTHING
        self._text.append(value)
        return Entered(bytes((value,)))

    def feed_closed(self, value: int) -> Entered:
        """Take one character while no line is accepted: only name and @, name and | are."""
        match self._place:
            case _Place.START:
                return self._begin(value)
            case _Place.MINE if value in b"@|" and not self._text:
                self._place = _Place.TAKEN
                return Entered(bytes((value,)), interrupt=value)
            case _Place.TAKEN:
                return self._taken(value)
        return self._foreign(value)

    def skips(self, value: int) -> bool:
        """Take a character that means nothing to this axis; False, and it is not taken, if it may mean something.

        Of 32 axes on a line, 31 do nothing else with nearly every character.
        """
        place = self._place
        if self._passes or value in AT_ONCE:
            return False
        if place is _OTHERS:
            if value == LF:
                self._place = _START
            return True
        if place is not _START or value == self.name:
            return False
        if value != LF:
            self._place = _OTHERS
        return True

    @property
    def turned_away(self) -> int | None:
        """Its name, within a line for others that it does not pass on."""
        return self.name if self._place is _OTHERS and not self._passes else None

    def clear(self) -> None:
        """As behind a LF."""
        self._place = _Place.START
        self._text.clear()
        self._too_long = False

    def _begin(self, value: int) -> Entered:
        """The character behind a LF."""
        passed = bytes((value,)) if self._passes else b""
        if value == LF:
            return Entered(passed)
        self._place = _Place.MINE if value == self.name else _Place.OTHERS
        return Entered(bytes((value,)) if self._place is _Place.MINE else passed)

    def _taken(self, value: int) -> Entered:
        if value != LF:
            return NOTHING
        self.clear()
        return Entered(bytes((LF,)))

    def _foreign(self, value: int) -> Entered:
        if value == LF:
            self.clear()
        else:
            self._place = _Place.OTHERS
        return Entered(bytes((value,)) if self._passes else b"")
