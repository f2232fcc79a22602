"""One exchange with a BS0610 or BS0710 board under GenStepper 2.18 (manual, pages 22 to 24, 35, 39 and 40).

There are no frames: every command character is answered by the prompt ``*``, behind the text if it has one, and any
new character drops what has not been sent yet. So an exchange is one write - the motor's letter, the commands, and a
report as the last - and is over with the text of that report and its prompt. Prompts of the commands before it may
come or not; they look like no report. Nothing is sent while an answer is due. After a silence ``00`` flushes what may
still come.
"""

import re
from enum import IntEnum
from typing import Final

from detent.hosts.axis import Axis
from detent.hosts.errors import ECHOES, BadAnswer, DriverError, NoAnswer, Spoken
from detent.hosts.exchange import Ask, Clear, Pause, Steps

MOTORS: Final = ("X", "Y")
LINE_BITS = 12  # a character of an answer, with the two more stop bits of V bit 1
LONGEST = 150  # characters of an answer: all reports of a motor
PATIENCE = 1.0  # seconds that a board, an adapter and this computer may take to begin an answer
TRIES = 3
FLUSH = b"00"
SIGN_ON: Final = re.compile(rb"\$version: ([0-9.]+)\$.*\*", re.DOTALL)
RESET: Final = "was switched off and on, or reset: it is at 0, with the settings of power-on; say it again"
FLUSH_SECONDS = 0.05  # until the character that was being sent has come, through whatever adapter

ACTION = -8


class Action(IntEnum):
    """What a motor does: report -8 (page 42)."""

    IDLE = 0
    RAMPING_UP = 1
    RUNNING = 2
    SLOWING = 3
    SLEWING = 4
    STOPPING = 5
    REVERSING = 6
    STOPPING_TO_GO = 7
    FINISHED = 8


class Dialogue(Axis):
    """One motor of a board, `motor` X or Y; the drivers of both share the port.

    `baud` as the board is made for; `patience` is how many seconds it may take to begin an answer.
    """

    def __init__(self, motor: str = "X", *, baud: int = 9600, patience: float = PATIENCE) -> None:
        if motor not in MOTORS:
            raise ValueError(f"a board has the motors {' and '.join(MOTORS)}, not {motor!r}")
        self.motor = motor
        self.title = f"motor {motor} of the GenStepper board"
        self.patience = patience
        self._timeout = patience + LONGEST * LINE_BITS / baud
        self._stale = True  # something may have come, or may still come, that nobody asked for
        self._met = False  # it has answered: if it signs on now, what was agreed on with it is gone
        self._due = ""  # commands that give back what a call that was broken off may have left changed

    def forget(self) -> None:
        """The connection was lost, or the board was reset: what comes first may be old."""
        self._stale, self._met, self._due = True, False, ""

    def ask(  # type: ignore[override]  # a question in commands, where the base has bytes
        self, commands: str, number: int, *, again: bool = True, leaves: str = ""
    ) -> Steps[tuple[int, ...]]:
        """Say `commands` to the motor, behind what is due, then ask for report `number`; its values, eleven for 0.

        `again`: all of it may be said again if the answer does not come whole. `leaves` is due from then on, even if
        this is broken off. Raises NoAnswer, BadAnswer.
        """
        values = rb"(?:,-?\d+){11}" if number == 0 else rb",[0-8]" if number == ACTION else rb",-?\d+"
        wanted = re.compile(rb"%b,%d(%b)(?:\r\n)?\*" % (self.motor.encode(), number, values))
        due, self._due = self._due, leaves or self._due
        found = yield from self.exchange(f"{self.motor}{due}{commands}{number}?", wanted, again=again)
        self._due = leaves
        return tuple(int(value) for value in found[1].split(b",")[1:])

    def order(self, commands: str, *, again: bool = True, leaves: str = "") -> Steps[Action]:
        """Say `commands` to the motor; returned is what it does then."""
        (action,) = yield from self.ask(commands, ACTION, again=again, leaves=leaves)
        return Action(action)

    def at_once(self, commands: str) -> Steps[None]:
        """Say `commands` to the motor before old answers are waited for. They are to be said again behind that."""
        if self._stale:
            yield Ask(f"{self.motor}{commands}".encode("ascii"))

    def exchange(
        self, text: str, wanted: re.Pattern[bytes], *, again: bool = False, more: float = 0.0
    ) -> Steps[re.Match[bytes]]:
        """Send `text` and wait until `wanted` has come, for `more` seconds longer than an answer takes."""
        data, timeout = text.encode("ascii"), self._timeout + more
        if self._stale:
            yield from self._flush()
        self._stale = True
        for left in reversed(range(TRIES)):
            answer = yield Ask(data, lambda came: found.end() if (found := wanted.search(came)) else None, timeout)
            match = wanted.search(answer.data)
            if self._met and b"$version" in answer.data and wanted is not SIGN_ON:
                self.forget()
                raise BadAnswer(self.title, RESET, Spoken(data, answer.data))
            if match is not None:
                self._met = True
                self._stale = False
                return match
            yield from self._flush()
            if not (left and again):
                break
        raise self._trouble(data, answer.data, timeout, again)

    def _trouble(self, data: bytes, came: bytes, timeout: float, again: bool) -> DriverError:
        spoken = Spoken(data, came)
        may = "" if again else "; it may have obeyed"
        advice = may and "ask moving() and position()"
        if came == data:
            return BadAnswer(self.title, ECHOES, spoken)
        if b"$version" in came:
            what = (
                "has just been reset and did not hear what it was told: wait until it has signed on, and say it again"
            )
            return BadAnswer(self.title, what, spoken)
        if b"*" in came:
            return BadAnswer(self.title, f"its answer was damaged{may}", spoken, advice)
        what = "does not finish its answer" if came else "does not answer"
        return NoAnswer(self.title, f"{what} within {timeout:.3g} s{may}", spoken, advice)

    def _flush(self) -> Steps[None]:
        """Drop what the board may still have to say, and what it has said."""
        yield Ask(FLUSH)
        yield Pause(FLUSH_SECONDS)
        yield Clear()
