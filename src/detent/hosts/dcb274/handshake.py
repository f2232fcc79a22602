"""How a line gets to a DCB-274 and its answer back: single mode, party line, daisy chain, SIN-10 (pages 15 to 28).

The unit's UART holds one character (page 25): the next one may go out only when the last was echoed. The manual
demands that of hosts on party lines and daisy chains; in single mode it demands no handshake, because it wants no
host there (page 22), but the UART is the same, so the same is done. An echo that is wrong or missing is found
before the line is complete: the line is taken back and entered again, so nobody carries out half of it.
"""

import re
from typing import Final

from detent.hosts.errors import ECHOES, BadAnswer, DriverError, NoAnswer, Refused, Spoken
from detent.hosts.exchange import Ask, Clear, Driver, Pause, Steps, attempt, length, until

BS, LF, CR, SPACE, ESC = b"\x08", b"\n", b"\r", b" ", b"\x1b"
CTRL_C, CTRL_N, CTRL_P = b"\x03", b"\x0e", b"\x10"
SINGLE_LONGEST: Final = 15  # characters of a line (page 22)
NAMED_LONGEST: Final = 12  # behind the name (page 25)
ADAPTER_LONGEST: Final = 256  # characters of a line of commands (page 19)
NOT_NAMES: Final = "[\\]^_`@"  # and ^C, CR, LF (page 23)
ADAPTERS_OWN: Final = ";&*"  # mean something to a SIN-10: no names behind one
SPOIL: Final = b"`" * (NAMED_LONGEST + 1)  # no name, no command, and longer than a line may be
TRIES: Final = 3  # to enter a line
STOP_TRIES: Final = 20  # to give the stop command: a unit that ramps down out of a program takes no line meanwhile
BABBLES: Final = 6  # times the patience: so long it is tried where something else comes, too, as no unit ramps down so
SPACING: Final = 0.02  # seconds between characters of a stop whose echo is not known
STORED: Final = 0.5  # seconds in which the end of a program is written
RESTART: Final = 0.1  # seconds that a unit may take from ^C or ^P until it listens
SCAN: Final = 10.0  # seconds for `&`: 86 names, each with a time-out of the adapter's own


RESET: Final = "was switched off and on, or reset: it is at 0, with the settings of its NV memory"


class NotListening(NoAnswer):
    """Not even the first character is echoed: a program runs, a command waits, the axis jogs, or nobody is there."""


def is_name(text: str) -> bool:
    """Whether this is one character that may be the name of an axis (page 23), and can be typed."""
    return len(text) == 1 and "!" <= text <= "~" and text not in NOT_NAMES


def next_name(name: str) -> str:
    """The name behind `name` in ASCII order."""
    names = [chr(value) for value in range(0x21, 0x7F) if is_name(chr(value))]
    return names[(names.index(name) + 1) % len(names)]


class Handshake(Driver):
    """One way to bring lines to one unit. `patience`: seconds for an echo. `running`: a program is known to run.

    `longest` is how many characters fit into a line, behind the name where there is one.
    """

    longest: int = SINGLE_LONGEST

    def __init__(self, name: str, patience: float) -> None:
        self.name, self.patience = name, patience
        self.running = False
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

    def interrupt(self, character: bytes, *, known: bool) -> Steps[None]:
        """Send ``@`` or ``|``, where lines have names: also a unit that runs a program takes it (page 28).

        For the unit that runs nothing it is a line like any other, and means the same. It is on the line before
        anything is waited for that may not come. `known`: no part of another line stands before it.
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


class SingleMode(Handshake):
    """One axis on the line, signed on with SPACE. Characters are echoed, CR is not; the answer ends in CR LF.

    `printed` are the lines that programs have printed and nobody has taken yet, `examined` what X said at sign-on,
    `programming` whether the unit was found storing what it is sent: somebody has begun a program (page 47).
    """

    def __init__(self, patience: float) -> None:
        super().__init__("", patience)
        self.printed: list[str] = []
        self._begun = ""  # of a line that a program is printing
        self.examined = ""
        self.programming = False
        self._typed = False  # a line went unanswered

    def connect(self) -> Steps[str]:
        """Sign on unless that was done; take back what stands in the line; stop continuous reports (Z 1).

        SPACE is harmless in either case, and X tells what state the unit is in, because program mode refuses it.
        Raises NoAnswer, BadAnswer, Refused (program mode).
        """
        yield Clear()
        answer = yield Ask(SPACE, until(b"\r\n"), self.patience)
        if not answer.data:
            what = "does not answer SPACE: it runs a program, which ESC ends, is on a party line, or is off"
            raise NoAnswer(self.title, what, Spoken(SPACE, b""), "abort() sends ESC")
        version = re.search(rb"V\d+\.\d+", answer.data)
        if version is not None:
            yield from self._named()
        self._typed = False
        if version is None:
            if answer.whole:
                what = "answers SPACE with neither an echo nor a sign-on line; ESC ends what it does"
                raise BadAnswer(self.title, what, Spoken(SPACE, answer.data))
            yield from self._erase()
        self.examined = yield from self._among_reports("X")
        if self.examined == "#":
            what = "is in program mode, where lines are stored: P ends it, and so does ESC"
            self.programming = True
            raise Refused(self.title, what, Spoken(b"X\r", b"X#\r\n"), "#", "abort() sends ESC")
        self.programming = False
        yield from self.reports_off()
        return version.group().decode() if version else ""

    def signs_on(self) -> Steps[bool]:
        """SPACE is answered with the version then (page 23), and by nothing where a program runs or a command waits."""
        answer = yield Ask(SPACE, until(b"\r\n"), self.patience)
        if answer.data == SPACE:
            yield from self._erase()
        if re.search(rb"V\d+\.\d+", answer.data) is None:
            return False
        yield from self._named()
        return True

    def _named(self) -> Steps[None]:
        """It has signed on. If it was reset while a line was typed it has taken a character of that for its name."""
        if self._typed:
            yield from self.restart(CTRL_C)
            yield Ask(SPACE, until(b"\r\n"), self.patience)
        self._typed = False

    def line(self, text: str, seconds: float, tries: int = TRIES) -> Steps[str]:
        """Each character when the echo of the last has come, CR, the result up to CR LF."""
        yield from self.enter(text, tries)
        answer = yield Ask(CR, until(b"\r\n"), self.patience + seconds)
        spoken = Spoken(text.encode() + CR, text.encode() + answer.data)
        if not answer.whole:
            self._typed = True
            raise NoAnswer(self.title, f"echoes {text!r} but does not finish its answer: was its supply lost?", spoken)
        result = answer.data[:-2].decode("latin-1")
        if result == "#":
            raise self.refused(text, spoken)
        return result

    def enter(self, text: str, tries: int = TRIES) -> Steps[None]:
        """A line without its CR. Raises NotListening, and BadAnswer when the echo is wrong again and again."""
        echo = b""
        for _ in range(1 if self.running else tries):
            yield Clear()
            echo = b""
            for character in text.encode("latin-1"):
                answer = yield Ask(bytes((character,)), length(1), self.patience)
                echo += answer.data
                if answer.data != bytes((character,)):
                    break
            else:
                return
            if not self.running:
                yield from self._erase()
        self._typed = not self.running
        spoken = Spoken(text.encode("latin-1"), echo)
        if not echo:
            raise NotListening(
                self.title, "takes no line: a program runs, it jogs, it was reset, or it is not there", spoken
            )
        raise BadAnswer(self.title, f"did not echo {text!r} as it is; the line was taken back", spoken)

    def soft_stop(self, *, known: bool, signed_on: bool) -> Steps[None]:
        """``@`` until the unit has taken it and takes lines again. Raises NoAnswer, BadAnswer.

        ``@`` is not echoed and acts at once where a program runs, a command waits, or a hand jogs (pages 28 and 33); it
        is echoed, and is a line of its own, where lines are taken. `known`: the line is empty, and no program mode is
        on. Otherwise an ``@`` that is echoed stands behind something: it is taken back with all of that, and it is seen
        whether lines are stored. SPACE would not do: a unit with a command that waits does not answer it. Without it
        `signed_on` a unit may wait for just that, which is seen behind the first ``@``.

        A unit that ramps down says nothing. So where other things come again and again the line babbles: that is told
        soon, and a silence only when it is longer than a ramp.
        """
        heard, wrong, others, began, sure = b"", 0, 0, None, known
        asked = not signed_on
        for _ in range(STOP_TRIES):
            yield Clear()
            answer = yield Ask(b"@", until(b"@"), self.patience)
            began = answer.at if began is None else began
            if others > TRIES or answer.at > began + (BABBLES if others or wrong else STOP_TRIES) * self.patience:
                break
            if not answer.whole:
                heard = answer.data.replace(b"#\r\n", b"")
                others += bool(heard)
                self._print(heard)
                if not signed_on:
                    yield from self.signs_on()
                    signed_on = True
                continue
            if not known:
                yield from self._erase(SINGLE_LONGEST + 1)
                yield from self._end_program_mode()
                yield Clear()
                answer = yield Ask(b"@", length(1), self.patience)
                if answer.data != b"@":
                    heard, wrong = answer.data, wrong + 1
                    continue
            answer = yield Ask(CR, until(b"\r\n"), self.patience)
            if answer.data == b"\r\n" and (sure or not (yield from self._stores_lines())):
                return
            if answer.data == CR:  # which no unit echoes
                raise BadAnswer(self.title, ECHOES, Spoken(b"@\r", b"@\r"))
            heard, known, sure, wrong = answer.data, False, False, wrong + 1
            if wrong >= TRIES:
                break
        spoken = Spoken(b"@\r", heard)
        if others or wrong:
            what = "answers its stop command with something else; it was told to stop, and may still move"
            raise BadAnswer(self.title, what, spoken, "abort() sends ESC")
        if not asked and (yield from self.signs_on()):
            raise NoAnswer(self.title, RESET, spoken)
        what = "does not take its stop command: it is off, or the line is broken"
        raise NoAnswer(self.title, what, spoken, "abort() sends ESC")

    def _end_program_mode(self) -> Steps[None]:
        """P, if lines are stored (page 47). An empty line is taken."""
        if (yield from self._stores_lines()):
            yield from attempt(self.line("P", STORED))

    def _stores_lines(self) -> Steps[bool]:
        """Whether X is refused, and again: the first may have stood behind something. P where none are begins that."""
        for _ in range(2):
            told = yield from attempt(self._among_reports("X"))
            if told != "#":
                return False
        return True

    def over(self) -> Steps[bool]:
        """X is in no line that a program prints, so its echo is found among them; without one a program runs."""
        answer = yield Ask(b"X", until(b"X"), self.patience)
        self._print(answer.data.removesuffix(b"X"), whole=answer.whole)
        if not answer.whole:
            return False
        yield Ask(CR, until(b"\r\n"), self.patience)
        return True

    def overhear(self, seconds: float) -> Steps[None]:
        """What a program prints, up to the end of a line."""
        self._print((yield Ask(b"", until(b"\n"), seconds)).data)

    def escape(self) -> Steps[None]:
        """ESC is answered by ``#`` CR LF (page 33), of other firmware perhaps by ``#`` alone.

        Before sign-on it is obeyed and answered by nothing: then SPACE shows that somebody is there.
        """
        answer = yield Ask(ESC, until(b"#\r\n"), self.patience)
        if answer.whole or answer.data.endswith(b"#"):
            return
        signed = yield Ask(SPACE, until(b"\r\n"), self.patience)
        if not (signed.whole and re.search(rb"V\d+\.\d+", signed.data)):
            what = "answers neither ESC nor SPACE: it is on a party line, or is off"
            raise NoAnswer(self.title, what, Spoken(ESC + SPACE, answer.data + signed.data))

    def reports_off(self) -> Steps[str]:
        """Z without a number ends continuous reports (page 53), which come between its echo and its answer."""
        return (yield from self._among_reports("Z"))

    def _among_reports(self, letter: str) -> Steps[str]:
        """A command of one letter that no report contains; its answer, with reports that came before it."""
        yield from self.ask(letter.encode(), until(letter.encode()), self.patience)
        answer = yield Ask(CR, until(b"\r\n"), self.patience)
        if answer.data == CR:  # which no unit echoes
            raise BadAnswer(self.title, ECHOES, Spoken(letter.encode() + CR, letter.encode() + CR))
        if not answer.whole:
            what = "does not finish its answer" if answer.data else "does not answer"
            spoken = Spoken(letter.encode() + CR, letter.encode() + answer.data)
            raise NoAnswer(self.title, f"{what} within {self.patience:g} s", spoken)
        return answer.data[:-2].decode("latin-1")

    def _erase(self, most: int = 2 * SINGLE_LONGEST) -> Steps[None]:
        """Take back what stands in the line: BS is echoed as long as there is something (page 22)."""
        for _ in range(most):
            answer = yield Ask(BS, until(BS), self.patience)
            if not answer.whole:
                return

    def _print(self, data: bytes, *, whole: bool = False) -> None:
        """Keep the lines of what a program has printed; what of the last one has come waits for its rest."""
        *lines, self._begun = (self._begun + data.decode("latin-1")).replace("\r", "\n").split("\n")
        if whole:
            lines, self._begun = [*lines, self._begun], ""
        self.printed += filter(str.strip, lines)


class PartyLine(Handshake):
    """Lines with a name: LF, name, up to 12 characters, LF; the axis of that name echoes and sends the LF back.

    The LF that ends one line begins the next, for every axis and whichever driver sent it.
    """

    longest = NAMED_LONGEST

    def connect(self) -> Steps[str]:
        """Spoil whatever stands in the line, then ask whether the axis is there (page 26).

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
            echo = b""
            for character in entered:
                answer = yield Ask(bytes((character,)), length(1), self.patience)
                echo += answer.data
                if answer.data != bytes((character,)):
                    break
            else:
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
                yield from self._end_program_mode()
                yield from self.enter(character.decode("latin-1"), TRIES - 1)
        ended = yield from self.ask(LF, until(b"\n"), self.patience)
        if ended.startswith(b"#"):
            yield from self.ask(b"", until(b"\n"), self.patience)

    def _end_program_mode(self) -> Steps[None]:
        """P, if it does not say how it moves, and again: lines are stored then (page 47). A bit makes P of @."""
        for _ in range(2):
            told = yield from attempt(self.line("^", 0.0))
            if not isinstance(told, str) or told.strip():
                return
        yield from attempt(self.line("P", STORED))

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
        """Give names if nobody has done so since the last reset, then ask the axis how it moves."""
        yield from self._have_names()
        if not (yield from self.line("^", 0.0)):
            what = f"is not in the chain, whose first axis is {self.first}"
            raise NoAnswer(self.title, what, Spoken(self.name.encode() + b"^\n", self.name.encode() + b"^\n"))
        return ""

    def _have_names(self) -> Steps[None]:
        yield Clear()
        passed = yield Ask(LF, until(b"\n"), self.patience)
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

    def escape(self) -> Steps[None]:
        """ESC goes round, and every axis answers it."""
        yield from super().escape()
        yield Pause(self.patience)
        yield Clear()


class Adapter(Handshake):
    """A SIN-10 in between: it takes lines of commands, does the handshake, answers each command with one line.

    Before anything else it must look for axes (``&``, "required initialization", page 19), which sends ^P: every axis
    is reset in party line mode. So that is done only while the adapter knows no axis at all.
    """

    longest = NAMED_LONGEST

    def connect(self) -> Steps[str]:
        """Ask the axis how it moves. If the adapter knows no axis yet, look for axes."""
        yield Clear()
        try:
            yield from self.line("^", 0.0)
        except Refused as error:
            known = yield from self.known()
            if known:
                what = f"is not known to the adapter, which knows {', '.join(known)}; & looks anew, and resets all"
                raise NoAnswer(self.title, what, error.spoken, "scan() sends &") from None
            yield from self.scan()
        except NotListening:
            pass  # it is known, and runs a program
        return ""

    def known(self) -> Steps[str]:
        """The names that the adapter knows: to commands for others it answers ``#`` itself."""
        names = [chr(value) for value in range(0x21, 0x7F) if is_name(chr(value)) and chr(value) not in ADAPTERS_OWN]
        known = ""
        for half in (names[::2], names[1::2]):
            replies = yield from self.spool([f"{name}^" for name in half], SCAN)
            known += "".join(name for name, reply in zip(half, replies, strict=True) if reply != "#")
        return "".join(sorted(known))

    def scan(self) -> Steps[str]:
        """``&``: the names of the axes that are there. Every axis is reset."""
        data = yield from self.ask(b"&\r", until(b"\r\n"), self.patience + SCAN)
        names = data[:-2].decode("latin-1")
        if self.name not in names:
            found = f"it has found {', '.join(names)}" if names else "it has found none"
            raise NoAnswer(self.title, f"is not on the adapter's party line; {found}", Spoken(b"&\r", data))
        return names

    def line(self, text: str, seconds: float, tries: int = TRIES) -> Steps[str]:
        """The command behind its name; the reply has it again, and the result behind."""
        yield Clear()
        (reply,) = yield from self.spool([self.name + text], seconds)
        spoken = Spoken((self.name + text + "\r").encode("latin-1"), (reply + "\r\n").encode("latin-1"))
        if reply == "#":
            what = "is not known to the adapter; & looks for axes, and resets all"
            raise Refused(self.title, what, spoken, "#", "scan() sends &")
        if reply == "?":
            raise NotListening(self.title, "takes no line: a program runs, it jogs, or it is gone", spoken)
        if reply.endswith("?"):
            raise NoAnswer(self.title, f"did not echo all of {text!r}", spoken)
        if not reply.startswith(self.name + text):
            raise BadAnswer(self.title, f"answers something else than {self.name + text!r}", spoken)
        result = reply.removeprefix(self.name + text)
        if result == "#":
            raise self.refused(text, spoken)
        return result

    def spool(self, commands: list[str], seconds: float) -> Steps[list[str]]:
        """Commands with their names in one line, ``;`` between; one reply each, as it comes."""
        data = ";".join(commands).encode("latin-1") + CR
        if len(data) > ADAPTER_LONGEST:
            raise ValueError(
                f"{len(data)} characters: the adapter's buffer holds {ADAPTER_LONGEST}; send fewer at once"
            )
        count = len(commands)

        def complete(came: bytes) -> int | None:
            lines = came.split(b"\r\n", count)
            return len(came) - len(lines[-1]) if len(lines) > count else None

        replies = yield from self.ask(data, complete, self.patience * (1 + count) + seconds)
        return replies.decode("latin-1").split("\r\n")[:-1]

    def interrupt(self, character: bytes, *, known: bool) -> Steps[None]:
        """A command like any other for the adapter: the unit echoes name and character while it runs.

        An adapter that knows no such axis looks for axes first, which resets them (page 19).
        """
        refused = yield from attempt(self.line(character.decode("latin-1"), 0.0))
        if isinstance(refused, Refused) and not known:
            yield from self.connect()
            yield from self.line(character.decode("latin-1"), 0.0)
        elif isinstance(refused, DriverError):
            raise refused

    def over(self) -> Steps[bool]:
        """Whether it says how it moves."""
        try:
            yield from self.line("^", 0.0)
        except NotListening:
            return False
        return True

    def escape(self) -> Steps[None]:
        """ESC goes through at once; the adapter answers ``#``."""
        yield from self.ask(ESC, until(b"#\r\n"), self.patience)


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
