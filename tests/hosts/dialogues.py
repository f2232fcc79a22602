r"""Dialogues of host drivers as text files: what a call sends, what the device answers, what comes of it.

The first line of a file names the manual's section and says what is proved; what stands before the first scene is
the header of all. No port, no process, no time: the plain driver's generators are played with the answers.

    scene TITLE                begins afresh
    unit GsC200(address=2)     the driver, a Python expression in the names that the test gives
    call position()            a call of it; further calls may follow in the same scene
    > 2V16\r                   what it must send next, escapes as in Python; what is sent in parts may stand whole
    < V100\r                   what the device answers
    silence                    nothing (more) comes, and the time runs out
    lost                       the port goes away
    pause 0.25                 it lets time pass, here: to be given only where the manual demands it
    = 100                      what the call returns, a Python expression in the same names; left out for None
    ! Refused E2               what it raises, and what the text of that must hold
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from detent.hosts.errors import PortLost
from detent.hosts.exchange import NOTHING, Answer, Ask, Clear, Pause, Progress, Rest, Step


class Scene(NamedTuple):
    """One scene: its title and its lines with their numbers."""

    title: str
    lines: list[tuple[int, str]]


def scenes(file: Path) -> Iterator[Scene]:
    """The scenes of a file, each with the header before its own lines."""
    header: list[tuple[int, str]] = []
    scene: Scene | None = None
    for number, raw in enumerate(file.read_text().splitlines()[1:], 2):
        line = raw.rstrip() if raw.startswith((">", "<")) else raw.split("#")[0].strip()
        if line.startswith("scene "):
            if scene is not None:
                yield scene
            scene = Scene(line.removeprefix("scene "), list(header))
        elif line:
            (header if scene is None else scene.lines).append((number, line))
    if scene is not None:
        yield scene


def unescape(text: str) -> bytes:
    return text.encode("latin-1").decode("unicode_escape").encode("latin-1")


class Player:
    """Plays one scene; AssertionError with the line where it goes wrong."""

    def __init__(self, scene: Scene, names: Mapping[str, Any]) -> None:
        self.lines = list(scene.lines)
        self.names = dict(names)
        self.number = 0
        self.sending = b""  # of a `>` line, and not sent yet
        self.coming = b""  # of a `<` line, and not read yet
        self.unit: Any = None
        while self.lines:
            word, rest = self.take()
            match word:
                case "unit":
                    self.unit = eval(rest, self.names)
                case "call":
                    self.call(rest)
                case _:
                    self.fail(f"{word!r} stands where a call should")

    def peek(self) -> str:
        return self.lines[0][1].partition(" ")[0] if self.lines else ""

    def take(self) -> tuple[str, str]:
        self.number, line = self.lines.pop(0)
        word, _, rest = line.partition(" ")
        return word, rest

    def fail(self, message: str) -> None:
        raise AssertionError(f"line {self.number}: {message}")

    def check(self, truth: bool, message: str) -> None:
        if not truth:
            self.fail(message)

    def call(self, text: str) -> None:
        result, error = None, None
        try:
            steps = eval(f"unit.{text}", {**self.names, "unit": self.unit})
            step = next(steps)
            while True:
                try:
                    answer = self.do(step)
                except ConnectionError:
                    self.unit.forget()
                    step = steps.throw(PortLost("unit", "the port is gone"))
                else:
                    step = steps.send(answer)
        except StopIteration as end:
            result = end.value
        except PortLost:
            pass
        except (RuntimeError, ValueError) as raised:
            error = raised
        self.check(not self.sending, f"{self.sending!r} was not sent")
        self.check(not self.coming, f"{self.coming!r} was not read")
        if self.peek() == "!":
            _, wanted = self.take()
            kind, _, part = wanted.partition(" ")
            self.check(error is not None, f"returned {result!r} and raised nothing")
            self.check(type(error).__name__ == kind and part in str(error), f"raised {error!r}")
            return
        if error is not None:
            raise AssertionError(f"line {self.number}: raised {error!r}") from error
        wanted = self.take()[1] if self.peek() == "=" else "None"
        self.check(result == eval(wanted, self.names), f"returned {result!r}, not {wanted}")

    def do(self, step: Step) -> Answer:
        match step:
            case Ask(data, complete, _):
                self.sent(data)
                return NOTHING if complete is None else self.heard(complete)
            case Pause(seconds) | Rest(seconds):
                if self.peek() == "pause":
                    _, rest = self.take()
                    self.check(float(rest) == seconds, f"pauses {seconds} s")
            case Clear():
                self.coming = b""
            case Progress(done, total):
                self.check(0 <= done <= total, f"is at {done} of {total}")
        return NOTHING

    def sent(self, data: bytes) -> None:
        while data:
            if not self.sending:
                self.check(self.peek() == ">", f"sent {data!r}, not expected before: {self.lines[:1]}")
                self.sending = unescape(self.take()[1])
            count = min(len(data), len(self.sending))
            self.check(data[:count] == self.sending[:count], f"sent {data!r}, not {self.sending!r}")
            data, self.sending = data[count:], self.sending[count:]

    def heard(self, complete: Any) -> Answer:
        came = b""
        while True:
            if not self.coming:
                if self.peek() == "<":
                    self.coming = unescape(self.take()[1])
                    continue
                if self.peek() == "lost":
                    self.take()
                    raise ConnectionError("lost")
                if self.peek() == "silence":
                    self.take()
                return Answer(came, whole=False)
            came, self.coming = came + self.coming[:1], self.coming[1:]
            count = complete(came)
            if count is not None:
                self.coming = came[count:] + self.coming
                return Answer(came[:count])
