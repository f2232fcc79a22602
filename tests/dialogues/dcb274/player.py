r"""Dialogues with DCB-274s as text files: what a host types, what comes back, what happens at the pins.

The first line of a file names the manual's pages and says what is proved. ``scene TITLE`` begins a fresh cell; what
stands before the first scene is the header of all. Characters take no time, commands take theirs.

    options name=B               of the one unit, `unit`; straps PARTY=1
    units X Y Z                  instead: axes of these names on one party line
    toml TEXT                    a line of the cell's TOML
    unsigned                     nobody has signed on (a single unit is signed on otherwise)

    > +1000                      a line and CR; >> X+1000\n  characters as they are
    < +1000                      a line and CR LF that must come next; << X+1000\n  characters that must come next
    program 0; + 1001; W 100     P 0, these lines, P: each must be answered with its echo
    quiet                        nothing may come within a second
    wait 1.5 s                   let time pass; characters that nobody expects fail at the next command or wait
    settle                       until nothing moves and no program runs
    pin GO = 0                   a level from outside; pin x.GO = 0 of several; power off; power on
    expect position 500          also state, pulses; an output: expect P4 = 0
    expect percent 10            the set current, of 4 A; expect amperes 0.4: the peak of both windings, in microsteps
    changes P4 = 20              so often has the output changed since the scene began
"""

from collections.abc import Iterator
from math import hypot
from pathlib import Path
from typing import NamedTuple

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.controllers.dcb274.firmware import Dcb274
from detent.pins import PinSet
from detent.ticks import MS, SECOND, parse_duration

LONGEST = 600 * SECOND
SIGN_ON = b"     110 AMS SMC-27X2 V1.10\r\n"


class Scene(NamedTuple):
    """One scene: its title and its lines with their numbers."""

    title: str
    lines: list[tuple[int, str]]


def scenes(text: str) -> Iterator[Scene]:
    """The scenes of a file, each with the header before its own lines."""
    header: list[tuple[int, str]] = []
    scene: Scene | None = None
    for number, raw in enumerate(text.splitlines()[1:], 2):
        line = raw.rstrip() if raw.startswith((">", "<")) else raw.split("#")[0].strip()
        if line.startswith("scene "):
            if scene is not None:
                yield scene
            scene = Scene(line.removeprefix("scene "), list(header))
        elif line:
            (header if scene is None else scene.lines).append((number, line))
    if scene is not None:
        yield scene


def files() -> list[Path]:
    """The dialogue files."""
    return sorted(Path(__file__).parent.glob("*.txt"))


def unescape(text: str) -> bytes:
    return text.encode("latin-1").decode("unicode_escape").encode("latin-1")


class Player:
    """Plays one scene; AssertionError with the line where it goes wrong."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.options: dict[str, str] = {}
        self.straps: dict[str, str] = {}
        self.names: list[str] = []
        self.toml: list[str] = []
        self.signed_on = True
        self.heard = b""
        self.number, self.line = 0, ""
        body = [(number, line) for number, line in scene.lines if not self.header(line)]
        self.cell = self.make()
        if self.signed_on and not self.names:
            self.send(b" ")
            self.expect(SIGN_ON)
        for self.number, self.line in body:
            word, _, rest = self.line.partition(" ")
            action = {">": self.say, ">>": self.say_raw, "<": self.hear, "<<": self.hear_raw}.get(word)
            (action or getattr(self, f"do_{word}"))(rest)
        self.nothing_left()

    def header(self, line: str) -> bool:
        word, _, rest = line.partition(" ")
        match word:
            case "options":
                self.options |= dict(item.split("=") for item in rest.split())
            case "straps":
                self.straps |= dict(item.split("=") for item in rest.split())
            case "units":
                self.names = rest.split()
            case "toml":
                self.toml.append(rest)
            case "unsigned":
                self.signed_on = False
            case _:
                return False
        return True

    def make(self) -> Cell:
        text = []
        for name in self.names or ["unit"]:
            options = self.options | ({"name": name} if self.names else {})
            text += [f"[units.{name}]", 'model = "dcb-274"', f"[units.{name}.options]"]
            text += [f'{option} = "{value}"' for option, value in options.items()]
            text += [f"[units.{name}.straps]", *(f"{pin} = {level}" for pin, level in self.straps.items())]
        text += ["[lines.line]", f"units = {self.names or ['unit']}", *self.toml]
        return build(parse("\n".join(text), "dialogue"), lambda file: "", line_timing=False)

    def check(self, truth: bool, message: str) -> None:
        assert truth, f"line {self.number}, {self.line!r} (at {self.cell.now} ns): {message}"

    def listen(self) -> None:
        self.heard += bytes(heard.char.value for heard in self.cell.lines[0].take())

    def nothing_left(self) -> None:
        self.listen()
        self.check(not self.heard, f"nobody expected {self.heard!r}")

    def send(self, data: bytes) -> None:
        self.nothing_left()
        self.cell.send(0, data)
        self.listen()

    def expect(self, data: bytes) -> None:
        self.listen()
        until = self.cell.now + LONGEST
        while len(self.heard) < len(data) and (at := self.cell.next_event()) is not None and at < until:
            self.cell.step()
            self.listen()
        found, self.heard = self.heard[: len(data)], self.heard[len(data) :]
        self.check(found == data, f"heard {found + self.heard!r}, not {data!r}")

    def say(self, rest: str) -> None:
        self.send(rest.encode() + b"\r")

    def say_raw(self, rest: str) -> None:
        self.send(unescape(rest))

    def hear(self, rest: str) -> None:
        self.expect(rest.encode() + b"\r\n")

    def hear_raw(self, rest: str) -> None:
        self.expect(unescape(rest))

    def do_program(self, rest: str) -> None:
        address, *lines = (part.strip() for part in rest.split(";"))
        for line in (f"P {address}", *lines, "P"):
            self.say(line)
            self.hear(line)

    def do_quiet(self, rest: str) -> None:
        self.cell.run_to(self.cell.now + SECOND)
        self.nothing_left()

    def do_wait(self, rest: str) -> None:
        self.nothing_left()
        self.cell.run_to(self.cell.now + parse_duration(rest))

    def do_settle(self, rest: str) -> None:
        until = self.cell.now + LONGEST
        busy = ("running", "moving", "homing")
        while any(unit.status(self.cell.now).state in busy for unit in self.cell.controllers().values()):
            self.check(self.cell.now < until, "it does not settle")
            self.cell.run_to(self.cell.now + MS)

    def place(self, name: str) -> tuple[str, str]:
        unit, dot, pin = name.rpartition(".")
        return (unit if dot else (self.names or ["unit"])[0]), pin

    def do_pin(self, rest: str) -> None:
        name, level = rest.split(" = ")
        self.cell.set_pin(*self.place(name), int(level))

    def do_power(self, rest: str) -> None:
        self.cell.power(self.place("")[0], rest == "on")

    def levels(self, name: str) -> list[int]:
        unit, pin = self.place(name)
        assert self.cell.recording is not None
        return [e.level for e in self.cell.recording.of(unit) if isinstance(e, PinSet) and e.pin == pin]

    def do_expect(self, rest: str) -> None:
        if " = " in rest:
            name, level = rest.split(" = ")
            self.check(self.levels(name)[-1] == int(level), f"it is {self.levels(name)[-1]}")
            return
        name, value = rest.split()
        unit, what = self.place(name)
        controller = self.cell.controller(unit)
        if what in ("percent", "amperes"):
            assert isinstance(controller, Dcb274)
            drive = controller.drive(self.cell.now)
            found = str(drive.percent) if what == "percent" else str(round(hypot(*drive.amperes), 9))
            self.check(found == value, f"it is {found}")
            return
        status = controller.status(self.cell.now)
        self.check(str(getattr(status, what)) == value, f"it is {status}")

    def do_changes(self, rest: str) -> None:
        name, count = rest.split(" = ")
        self.check(len(self.levels(name)) - 1 == int(count), f"it changed {len(self.levels(name)) - 1} times")
