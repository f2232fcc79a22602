"""One exchange with a GS-C200: what is said again, and when (datasheet, figure 4 and the error code table).

A frame that the module found damaged (E1) changed nothing, so it is sent again whatever it says. When the ANSWER was
damaged or lost, the module may have obeyed: then only what may safely be obeyed twice is said again.
"""

import re
from enum import Enum
from typing import Final, NamedTuple

from detent.hosts.axis import Axis
from detent.hosts.errors import ECHOES, BadAnswer, Busy, DriverError, MotionFailed, NoAnswer, Refused, Spoken
from detent.hosts.exchange import LONGEST_ANSWER, Answer, Ask, Clear, Pause, Steps, operation
from detent.hosts.gsc200.frames import LINE_BITS, Frames
from detent.hosts.gsc200.language import GS_C200S, MODELS

ERRORS: Final = {
    "E1": "parity error when receiving one or more characters, checksum error, or too long a command string",
    "E2": "command argument out of limit or not requested",
    "E3": "storage capacity overflow",
    "E4": "not allowed or not executable command",
    "E5": "overflow of the position counter",
    "E6": "EEPROM programming error",
}

LONGEST = 12  # characters of an answer, its checksum and CR among them
PATIENCE = 1.0  # seconds that a module, an adapter and this computer may take to begin an answer
TRIES = 3
MOMENT = 0.005  # seconds between two questions whether a short command is done
MOMENTS = 200
LISTED = 128  # lines of the longest list of a program, and more

MODES: Final = {"P": True, "Po": True, "P0": True, "Px": False, "E": False}
"""The commands that enter and leave programming mode."""
STOPS: Final = ("Z", "K")
COMMANDED: Final = ("Z", "K", "H", "X")
"""Commands that a module in programming mode answers with E4."""
MISTAKEN: Final = ("+", "-", "F")
"""Behind half a frame a move may be another command (``G`` and ``+100``), and F may be answered by what it can answer.

Any other command is refused there (E2, E4), as all are by a checksum.
"""
HARMLESS: Final = "V2"  # it changes nothing, in any mode

LEAVING: Final = (
    "it is in programming mode, which a GS-C200 leaves only by E (execute() in Python), and that starts the program; "
    "or switch it off and on"
)

ORDERED = re.compile(r"Y|B|E[1-6]")
LISTS = re.compile(r"(?!B$|E[1-6]$|END$).*")  # a line of a list, behind which more come
STATE = re.compile(r"R|B|E[1-6]")


class Again(Enum):
    """Whether a command may be said again when its answer was damaged or did not come."""

    AT_ONCE = "obeyed twice it does what it does once"
    WHEN_READY = "so, too, once the module is ready"
    NEVER = "obeyed twice it does more"


class Feedback(NamedTuple):
    """The answer to F: whether the module is busy, and the error that it kept (``E5``), told once."""

    busy: bool
    error: str = ""


class Dialogue(Axis):
    """One module on a line, which it may share with others (multipoint).

    `model` is gs-c200 or gs-c200s; `address` 1 to 7, or None point to point; `checksums` as CHS is strapped;
    `revision` that of a GS-C200's firmware (up to V2.1 checksums are not ORed); `baud` as BR0 to BR2 are strapped.
    `patience` is how many seconds a module may take before it answers, beside what its characters take.
    """

    def __init__(
        self,
        model: str = MODELS[0],
        *,
        address: int | None = None,
        checksums: bool = True,
        revision: str = "2.2",
        baud: int = 9600,
        patience: float = PATIENCE,
    ) -> None:
        if model not in MODELS:
            raise ValueError(f"no model {model!r} is driven so; it is {' or '.join(MODELS)}")
        if address is not None and address not in range(1, 8):
            raise ValueError(f"an address is 1 to 7 (multipoint), or None (point to point), not {address!r}")
        number = re.fullmatch(r"[Vv]?(\d+)\.(\d+)", revision)
        if number is None:
            raise ValueError(f"a revision is written like 2.1 or 2.2, not {revision!r}")
        self.model = model
        self.signed = model == GS_C200S
        """A GS-C200S: a counter with a sign, jumps, presets, and a way out of programming mode."""
        self.frames = Frames(address, checksums, self.signed or (int(number[1]), int(number[2])) >= (2, 2))
        self.title = model.upper() + ("" if address is None else f" at address {address}")
        self.patience = patience
        self._character = LINE_BITS / baud
        self.programming = False
        """Whether this driver has put the module into programming mode, where commands are stored."""
        self._stale = True  # something may have come, or may still come, that nobody asked for
        self._unread: tuple[float, int] | None = None  # a question whose answer nobody has waited for: seconds, lines
        self._unended = True  # the line may hold half a frame, of this driver or another: the beginning of the next
        self._known = False  # the mode is known: it is as `programming` says
        self._spoken: Spoken | None = None  # the last exchange that was understood
        self._begun = False  # this driver has begun what an error that the module keeps would be of, or has seen it
        self._clean = False  # the module is known to keep no error
        self._owed = ""  # an error of what was begun that was told to us between, and not yet by us
        self._homing = False  # homing was begun, and was not seen to end
        self._cut = False  # a homing was cut off: a GS-C200's counter may have gone below 0
        self._silent = False  # it gave no answer at all to something, since the last motion was begun
        self._target: int | None = None  # where the move under way should end, if that is known
        self._times_told = 0  # how often it was told to do something else

    def forget(self) -> None:
        """The connection was lost: what comes first may be old, and the module may have been switched off."""
        self._stale = self._unended = True
        self._unread = None
        self.programming = self._known = self._begun = self._clean = False
        self._owed = ""

    # -- exchanges ---------------------------------------------------------------------------------------

    def say(self, command: str, wanted: re.Pattern[str], again: Again, more: float = 0.0) -> Steps[str]:
        """The answer to `command`, which is one of `wanted`; E1 and what is damaged is dealt with.

        `more` is how many seconds the answer may take beyond what any may. Raises NoAnswer, BadAnswer, Refused (E1).
        """
        data = self.frames.frame(command)
        timeout = self.patience + more + self._character * (len(data) + LONGEST)
        stops = command in STOPS
        twice = self._stale and stops  # and two answers may come
        if self._stale:
            yield Clear()
            if stops:
                yield Ask(data)
            yield from self._passed()
        self._stale = True
        if command in MODES:
            self._known = False
        if self._unended and command[0] in MISTAKEN and not self.frames.checksums:
            self._unended = not (yield Ask(self.frames.frame(HARMLESS), self.frames.end, timeout)).whole
        for left in reversed(range(TRIES)):
            self._unread = (timeout, LISTED if command == "Q" else 2)
            answer = yield Ask(data, self.frames.end, timeout)
            self._unread = None
            text = self.frames.text(answer.data) if answer.whole else None
            self._silent = self._silent or not answer.data
            if answer.data == data:  # no answer reads as a question does
                self._unended = False
                yield from self._quiet()
                raise BadAnswer(self.title, ECHOES, Spoken(data, answer.data))
            unheard = text == "E1" or (self._unended and text in ("E2", "E4") and left > 0)
            if text is not None and not unheard and wanted.fullmatch(text):
                self._stale = twice or (command == "Q" and LISTS.fullmatch(text) is not None)
                self._unended = False
                self._spoken = Spoken(data, answer.data)
                if text == "Y" and command in MODES:
                    self.programming = MODES[command]
                self._known = self._known or text == "B" or (text == "Y" and command[0] in (*COMMANDED, *MODES))
                return text
            self._unended = not unheard
            rest = b"" if unheard else (yield from self._quiet(LISTED if command == "Q" else 2))
            trouble = self._trouble(command, answer, Spoken(data, answer.data + rest), timeout, unheard, again)
            if not left or not (unheard or again is not Again.NEVER):
                raise trouble
            if again is Again.WHEN_READY and not unheard and not (yield from self._settled()):
                raise trouble
        raise AssertionError("the last try returned or raised")

    def order(self, command: str, again: Again, more: float = 0.0) -> Steps[None]:
        """Say a command that is answered Y. Raises Busy, Refused with the datasheet's words."""
        self.judge(command, (yield from self.say(command, ORDERED, again, more)))

    def delayed(self, command: str, again: Again, *, begins: bool = False) -> Steps[None]:
        """Say a command of the delayed execution type; while programming it is stored, and then never said twice.

        One that `begins` something takes its time. Raises Busy where the module was left in programming mode and would
        store it.
        """
        if not self._known:
            yield from self._commands(command)
        if begins:
            self.begins()
        yield from self.order(command, Again.NEVER if self.programming else again)

    def _commands(self, command: str) -> Steps[None]:
        """See that the module would obey `command`, and not store it: K does nothing at rest, or is refused (E4).

        Whatever else is answered in programming mode is answered alike in command mode, or stored.
        """
        if not self._clean and (yield from self._asked()).busy:
            self.judge(command, "B")
        refusal = yield from self.say("K", ORDERED, Again.AT_ONCE)
        if refusal == "E4":
            way = "leave_programming() first" if self.signed else LEAVING
            raise Busy(self.title, f"would store {command} and not obey, as it was left in programming mode: {way}")
        self.judge("K", refusal)

    def setting(self, command: str) -> Steps[None]:
        """A delayed command that is over in a moment: it is obeyed when this returns. Raises Busy."""
        yield from self.delayed(command, Again.WHEN_READY)
        if not self.programming and not (yield from self._settled()):
            raise Busy(self.title, f"is still busy with {command}", code="B", advice="wait()")

    def judge(self, command: str, text: str) -> None:
        """Raise Busy or Refused if `text`, the answer to `command`, says so."""
        if text == "B":
            what = f"is busy and does not obey {command}; Z ramps down, K stops at once"
            raise Busy(self.title, what, self._spoken, "B", "wait(), stop() or halt()")
        if text in ERRORS:
            raise Refused(self.title, f"refuses {command}: {ERRORS[text]} ({text})", self._spoken, text)

    @operation
    def feedback(self) -> Steps[Feedback]:
        """F: whether it is busy; an error that ended a program is told once, whoever started that."""
        text = yield from self.say("F", STATE, Again.AT_ONCE)
        self._clean = text != "B"
        self._begun = self._begun or text == "B"
        return Feedback(text == "B", text if text.startswith("E") else "")

    @operation
    def moving(self) -> Steps[bool]:
        """Whether it is busy: with a move, homing, or a program.

        Raises MotionFailed for an error of what this driver has begun, or has seen going on. One that was there before,
        of an old program, is nothing that failed here: `feedback` tells it.
        """
        busy = (yield from self._asked()).busy
        error, self._owed = self._owed, ""
        if error:
            raise MotionFailed(self.title, f"ended early: {ERRORS[error]} ({error})")
        return busy

    def _asked(self) -> Steps[Feedback]:
        """F; an error of what this driver has begun, or has seen going on, is owed to whoever asks how that went."""
        told = yield from self.feedback()
        if told.error and self._begun:
            self._owed = told.error
        self._begun = self._begun and told.busy
        self._homing = self._homing and told.busy
        return told

    def begins(self) -> None:
        """Something is begun: an error that the module keeps from here on is of this."""
        self._begun, self._clean, self._owed, self._silent = True, False, "", False
        self.otherwise()

    def otherwise(self) -> None:
        """It is told to do something else than to end where the last move was to: who waits for that learns of it."""
        self._target = None
        self._times_told += 1

    def fresh(self) -> Steps[None]:
        """Fetch an error that an old program may have left, so that it is not blamed on what is begun now (F)."""
        if not self._clean:
            yield from self.feedback()

    # -- what goes wrong ---------------------------------------------------------------------------------

    def _passed(self) -> Steps[None]:
        """Let pass by what was said before, so that it is not taken for the answer to what is said now."""
        seconds, lines = self._unread or (0.0, 2)
        if self._unread is not None:  # a call was broken off, and its answer is due
            yield Ask(b"", self.frames.end, seconds)
            self._unread = None
        yield from self._quiet(lines)

    def _settled(self) -> Steps[bool]:
        """Wait until it is ready, a moment at most. Whether it is."""
        began = None
        for _ in range(MOMENTS):
            if not (yield from self._asked()).busy:
                return True
            now = (yield Pause(MOMENT)).at
            began = now if began is None else began
            if now - began > MOMENT * MOMENTS + self.patience:
                break
        return False

    def _quiet(self, lines: int = 2) -> Steps[bytes]:
        """Let whatever may still come pass by, so many lines of it: a line may babble for ever. What has come."""
        heard = b""
        began, longest, left = None, self.patience / 2 + lines * LONGEST * self._character, LONGEST_ANSWER
        while left > 0 and (came := (yield Ask(b"", len_or_none, 2 * LONGEST * self._character))).data:
            began = came.at if began is None else began
            left -= len(came.data)
            heard += came.data
            if came.at - began > longest:
                break
        return heard

    def _trouble(
        self, command: str, answer: Answer, spoken: Spoken, timeout: float, unheard: bool, again: Again
    ) -> DriverError:
        if unheard:
            what = f"does not receive {command} undamaged: {ERRORS['E1']} (E1); is CHS strapped as checksums says?"
            return Refused(self.title, what, spoken, "E1")
        may = "" if again is Again.AT_ONCE else f"; it may have obeyed {command}"
        advice = may and "ask moving() and position()"
        if answer.whole:
            plain = self.frames._replace(checksums=False).text(answer.data)
            if self.frames.checksums and plain is not None and (ORDERED.fullmatch(plain) or STATE.fullmatch(plain)):
                may = "; it came without a checksum: is CHS strapped low (checksums=False, --no-checksum)?"
                advice = ""
            return BadAnswer(self.title, f"its answer to {command} was damaged{may}", spoken, advice)
        what = "does not finish its answer" if answer.data else "does not answer"
        return NoAnswer(self.title, f"{what} to {command} within {timeout:.3g} s{may}", spoken, advice)


def len_or_none(data: bytes) -> int | None:
    """Complete as soon as anything is there, with all of it."""
    return len(data) or None
