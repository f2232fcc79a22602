"""DCB-274s that share a line: party line and daisy chain (pages 23 to 25, 28)."""

from typing import Final

from detent.hosts.dcb274.handshake import ESC, LF, NAMED_LONGEST, TRIES, Handshake, NotListening
from detent.hosts.dcb274.names import next_name
from detent.hosts.errors import BadAnswer, DriverError, NoAnswer, Spoken
from detent.hosts.exchange import Ask, Clear, Pause, Steps, attempt, length, until

SPOIL: Final = b"`" * (NAMED_LONGEST + 1)  # no name, no command, and longer than a line may be
SPACING: Final = 0.02  # seconds between characters of a stop whose echo is not known


class PartyLine(Handshake):
    """Lines with a name: LF, name, up to 12 characters, LF; the axis of that name echoes and sends the LF back.

    The LF that ends one line begins the next, for every axis and whichever driver sent it.
    """

    longest = NAMED_LONGEST

    def connect(self) -> Steps[str]:
        """Spoil whatever stands in the line, then ask whether the axis is there (page 26), and takes lines.

        A unit that waits for its sign-on takes that for the start of a daisy chain (page 23): it has this name until it
        is reset, and talks just so.
        """
        yield Clear()
        yield Ask(SPOIL + LF, until(b"\n"), self.patience)
        try:
            yield from self.line("", 0.0)
        except NotListening as error:
            what = "is not on the line: is this its name, and is it in party line mode (strap PARTY, or ^P)?"
            raise NoAnswer(self.title, what, error.spoken, "party_line() sends ^P") from None
        except NoAnswer as error:
            if error.spoken is None or error.spoken.received != self.name.encode("latin-1"):
                raise
            what = "is there and takes no line: a program runs, a command waits, or it jogs"
            raise NotListening(self.title, what, error.spoken, "stop() and halt() are taken") from None
        yield from self.takes_lines()
        return ""

    def line(self, text: str, seconds: float, tries: int = TRIES) -> Steps[str]:
        """Each character when the echo of the last has come; data stands before the LF of the axis."""
        yield from self.enter(text, tries)
        answer = yield Ask(LF, until(b"\n"), self.patience + seconds)
        entered = (self.name + text).encode("latin-1")
        spoken = Spoken(entered + LF, entered + answer.data)
        if not answer.whole:
            raise NoAnswer(
                self.title, f"echoes {self.name + text!r} but does not finish its answer: was its supply lost?", spoken
            )
        result = answer.data[:-1].decode("latin-1")
        if result == "#":
            raise self.refused(text, spoken)
        return result

    def enter(self, text: str, tries: int = TRIES) -> Steps[None]:
        """A line without its LF. Raises NotListening, and BadAnswer when the echo is wrong again and again."""
        entered = (self.name + text).encode("latin-1")
        echo = b""
        for _ in range(1 if self.running else tries):
            yield Clear()
            echo, whole = yield from self.spell(entered)
            if whole:
                return
            # An LF would have half a line carried out, ESC would stop every axis. A line that is too long and no
            # command besides is refused by whoever listens.
            spoilt = yield Ask(SPOIL + LF if echo else LF, until(b"\n"), self.patience)
            if echo == entered[:1] and not spoilt.whole:
                echo = b""  # it is there, and takes nothing behind its name but | and @
                break
        spoken = Spoken(entered, echo)
        if not echo:
            raise NotListening(self.title, "takes no line: a program runs, it jogs, or it is not there", spoken)
        raise BadAnswer(self.title, f"did not echo {entered!r} as it is; the line was spoilt", spoken)

    def interrupt(self, character: bytes, *, known: bool) -> Steps[None]:
        """Name and character, each echoed, and LF; before that may come the end of a command that waited.

        Where not even the name is echoed, all of it is said all the same: who hears it stops, though we may not hear
        that. A letter that is echoed wrongly is taken back, as it may be another command.
        """
        yield Clear()
        if not known:
            yield Ask(SPOIL + LF)
            yield Pause(SPACING)
            yield Clear()
        name = self.name.encode("latin-1")
        heard = (yield Ask(name, length(1), self.patience)).data == name
        if not heard or (yield Ask(character, length(1), self.patience)).data != character:
            yield Ask(SPOIL + LF if heard else character + LF)
            yield Pause(SPACING)
            yield from self.enter(character.decode("latin-1"), TRIES - 1)
            if not heard:
                yield from self.ask(LF, until(b"\n"), self.patience)
                yield from self.end_program_mode()
                yield from self.enter(character.decode("latin-1"), TRIES - 1)
        ended = yield from self.ask(LF, until(b"\n"), self.patience)
        if ended.startswith(b"#"):
            yield from self.ask(b"", until(b"\n"), self.patience)
        if not known and (yield from self.end_program_mode()):
            yield from self.interrupt(character, known=True)

    def over(self) -> Steps[bool]:
        """Whether it says how it moves."""
        try:
            return bool((yield from self.line("^", 0.0)))
        except NotListening:
            return False

    def escape(self) -> Steps[None]:
        """ESC is answered ``#`` LF, by all axes in the same bit times."""
        answer = yield Ask(ESC, until(b"#\n"), self.patience)
        if not answer.whole:
            raise NoAnswer(self.title, "does not answer ESC", Spoken(ESC, answer.data))


class DaisyChain(PartyLine):
    """A ring: each axis passes on what is not for it (pages 23 to 25). `first` is the name of the first axis.

    Names are given by the host after every reset: LF and the first name; what comes back is LF and the name that the
    next axis would have. What is sent comes back whether the axis is there or not: only an answer with data proves it.
    """

    def __init__(self, name: str, first: str, patience: float) -> None:
        super().__init__(name, patience)
        self.first = first
        self.names: tuple[str, ...] = ()  # that this driver has given

    def connect(self) -> Steps[str]:
        """Give names if nobody has done so since the last reset, then ask the axis what it is (X, page 52)."""
        yield from self._have_names()
        if not (yield from self.takes_lines()):
            what = f"is not in the chain, whose first axis is {self.first}"
            raise NoAnswer(self.title, what, Spoken(self.name.encode() + b"X\n", self.name.encode() + b"X\n"))
        return ""

    def _have_names(self) -> Steps[None]:
        """Half a line that stands in an axis is spoilt; to one that has no name these characters are none (page 23)."""
        yield Clear()
        passed = yield Ask(SPOIL + LF, until(b"\n"), self.patience)
        if not passed.whole:
            yield from self.assign()

    def assign(self) -> Steps[tuple[str, ...]]:
        """LF and the first name, to axes that have none (page 24); the names that were given."""
        sent = LF + self.first.encode("latin-1")
        answer = yield Ask(sent, length(2), self.patience)
        if not answer.whole or answer.data[:1] != LF:
            what = "do not take names: are they reset, and is the ring closed?"
            raise NoAnswer("the axes of the daisy chain", what, Spoken(sent, answer.data))
        names, last = [], answer.data[1:].decode("latin-1")
        name = self.first
        while name != last:
            names.append(name)
            name = next_name(name)
            if name == self.first:
                what = f"answers its names with {last!r}, which is none"
                raise BadAnswer("the daisy chain", what, Spoken(sent, answer.data))
        self.names = tuple(names)
        return self.names

    def interrupt(self, character: bytes, *, known: bool) -> Steps[None]:
        """As on a party line. Names come first: without one an axis takes the first character for its own."""
        missing = None if known else (yield from attempt(self._have_names()))
        told = yield from attempt(super().interrupt(character, known=True))
        if isinstance(missing, DriverError) and isinstance(told, DriverError):
            raise missing
        if isinstance(told, DriverError):
            raise told
        if not known and (yield from self.end_program_mode()):
            yield from super().interrupt(character, known=True)

    def escape(self) -> Steps[None]:
        """ESC goes round, and every axis answers it."""
        yield from super().escape()
        yield Pause(self.patience)
        yield Clear()
