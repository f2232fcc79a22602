"""A DCB-274 alone on its line, in single mode (pages 22 and 23)."""

import re
from typing import Final

from detent.hosts.dcb274.handshake import (
    BS,
    CR,
    CTRL_C,
    ESC,
    IN_PROGRAM_MODE,
    RESET,
    SINGLE_LONGEST,
    SPACE,
    TRIES,
    Handshake,
    NotListening,
)
from detent.hosts.errors import ECHOES, BadAnswer, NoAnswer, Refused, Spoken
from detent.hosts.exchange import Ask, Clear, Steps, attempt, length, until

STOP_TRIES: Final = 20  # to give the stop command: a unit that ramps down out of a program takes no line meanwhile
SOON: Final = 6  # of them where something else comes, as no unit ramps down so, or where no program is known to run


class SingleMode(Handshake):
    """One axis on the line, signed on with SPACE. Characters are echoed, CR is not; the answer ends in CR LF.

    `printed` are the lines that programs have printed and nobody has taken yet, `examined` what X said at sign-on.
    """

    def __init__(self, patience: float) -> None:
        super().__init__("", patience)
        self.printed: list[str] = []
        self._begun = ""  # of a line that a program is printing
        self.examined = ""
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
            self.programming = True
            raise Refused(self.title, IN_PROGRAM_MODE, Spoken(b"X\r", b"X#\r\n"), "#", "abort() sends ESC")
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
            echo, whole = yield from self.spell(text.encode("latin-1"))
            if whole:
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

        A unit that ramps down out of a program says nothing. So where other things come again and again the line
        babbles: that is told soon. So is a silence of a unit that took lines when it was last heard; of any other only
        when it is longer than a usual ramp.
        """
        heard, wrong, others, began, sure = b"", 0, 0, None, known
        silence = SOON if known and not self.running else STOP_TRIES
        asked = not signed_on
        for _ in range(STOP_TRIES):
            yield Clear()
            answer = yield Ask(b"@", until(b"@"), self.patience)
            began = answer.at if began is None else began
            if others > TRIES or answer.at > began + (SOON if others or wrong else silence) * self.patience:
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
                yield from self.end_program_mode()
                yield Clear()
                answer = yield Ask(b"@", length(1), self.patience)
                if answer.data != b"@":
                    heard, wrong = answer.data, wrong + 1
                    continue
            answer = yield Ask(CR, until(b"\r\n"), self.patience)
            if answer.data == b"\r\n" and (sure or not (yield from self.stores_lines())):
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
        what = "does not take its stop command: it is off, the line is broken, or it ramps down out of a program"
        raise NoAnswer(self.title, what, spoken, "abort() sends ESC")

    def stores_lines(self) -> Steps[bool]:
        """As everywhere; continuous reports (Z 1) may come in between."""
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
