r"""Dialogues with a controller as text files: what a host says, what is answered, what happens at the pins.

The first line of a file names the manual's place and says what is proved. A file has one or more scenes;
``scene TITLE`` begins one, and what stands before the first applies to all. Each scene starts a fresh cell at
virtual time 0. ``#`` begins a comment. Units are named by `unit` where a cell has several: ``pin two.UI1 = 0``.

How the cell is made (header of the file or of a scene):

    model gs-c200s               of the one unit, which is called `unit`
    straps CHS=0 REC=0           and its options:  options instruction_time=2ms
    timing on                    characters take their time, and the time of every answer is checked
    unpowered                    the unit is not switched on at time 0
    image S10 +5                 the program that lies in the EEPROM
    units one=1 two=2            instead: units of one multipoint line with their addresses
    toml TEXT                    a line of the cell's TOML, for switches and wires (units are there already)

What happens:

    > I3                         the host sends a command; checksum and CR are added here
    < Y                          a frame that must be the next to come; its checksum is verified
    >> A3\x00\r                  bytes as they are; 80h and more arrive with a parity error
    << Y\x59\r                   bytes that must come next
    run S10 +500                 P, each instruction, E, all answered Y (Po on a GS-C200S)
    store S10 +500               the same with M instead, and without E: Px on a GS-C200S
    pin UI1 = 0                  a level from outside;  switch NAME = 1  for a switch of the cell
    power off                    and on;  power off two  in a cell of several
    eeprom fails                 writing it;  eeprom works
    wait 1.5 s                   let time pass;  wait idle  until RDY is 1
    wait pulse 12                of the present motion, or of the next if nothing moves
    mark                         from here on times with a + are counted

What must be true:

    expect UO2 = 1               the level of an output;  open  without supply
    expect position 500          by the counter;  pulses 500  in all;  state running;  time 1.5 s
    edge MOV = 0 at +1.5 s       the pin took that level at that time
    pulse 50 at +90 ms           of the last motion, to the nanosecond
    edges UO1 = 4                how often the pin has changed since the mark

Answers that nobody expects fail, at the next command, wait or at the end.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

from detent.assembler import assemble
from detent.axis import MotionStarted
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.recording import Entry, Recording
from detent.controllers import catalogue
from detent.controllers.device import Powered
from detent.pins import PinSet
from detent.ticks import SECOND, parse_duration

LONG_ENOUGH = 10_000 * SECOND  # nothing in a dialogue takes longer
MOST_STEPS = 20_000  # nor more eventful instants in one wait
SELECT = {7: "000", 6: "100", 5: "010", 4: "110", 3: "001", 2: "101", 1: "011"}  # SEL2 SEL1 SEL0, as printed


class Scene(NamedTuple):
    """One scene: its title, the lines (with their numbers) that make its cell and that happen in it."""

    title: str
    header: list[tuple[int, str]]
    lines: list[tuple[int, str]]


_HEADER = ("model ", "straps ", "options ", "timing ", "unpowered", "image ", "units ", "toml ")


def scenes(text: str) -> Iterator[Scene]:
    """The scenes of a dialogue file."""
    common: list[tuple[int, str]] = []
    scene = Scene("", [], [])
    for number, raw in enumerate(text.splitlines()[1:], 2):
        line = raw.rstrip() if raw.startswith(("<<", ">>")) else raw.split("#")[0].strip()
        if not line.strip():
            continue
        if line.startswith("scene "):
            if scene.lines:
                yield scene
            scene = Scene(line.removeprefix("scene "), list(common), [])
        elif line.startswith(_HEADER) or line == "unpowered":
            scene.header.append((number, line))
            if not scene.title:
                common.append((number, line))
        else:
            scene.lines.append((number, line))
    yield scene


def files(folder: str) -> list[Path]:
    """The dialogue files of one controller, by name."""
    return sorted((Path(__file__).parent / folder).glob("*.txt"))


class Watched(Recording):
    """A recording that knows the present levels of all outputs."""

    def __init__(self, so_far: Recording) -> None:
        super().__init__(so_far.units)
        self.levels: dict[tuple[str, str], int] = {}
        for unit, entry in so_far:
            self.extend(unit, (entry,))

    def extend(self, unit: int, entries: Sequence[Entry]) -> None:
        super().extend(unit, entries)
        name = self.units[unit]
        for entry in entries:
            if isinstance(entry, PinSet):
                self.levels[name, entry.pin] = entry.level
            elif isinstance(entry, Powered) and not entry.on:
                self.levels = {place: level for place, level in self.levels.items() if place[0] != name}


class Player:
    """Plays one scene."""

    def __init__(self, scene: Scene) -> None:
        self.model, self.straps, self.options = "gs-c200", {}, {}
        self.timed = False
        self.powered = True
        self.addresses: dict[str, int] = {}
        self.images: dict[str, bytes] = {}
        self.toml: list[str] = []
        for number, line in scene.header:
            word, _, rest = line.partition(" ")
            self.number, self.line = number, line
            getattr(self, f"make_{word}")(rest)
        self.eeprom_works = True
        self.cell = self.make()
        watched = Watched(self.cell.recording)
        self.cell.recording = self.watched = watched
        self.marked = 0
        self.before: dict[str, int] = {}  # what each unit had done at the mark
        self.arrived: list[tuple[int, int]] = []  # characters that nobody has looked at: (instant, value)
        self.asked: list[int] = []  # when requests were complete, in timed scenes
        self.burst = (0, 0)  # start of the answers that go out without a pause, and characters so far

    # -- the cell ----------------------------------------------------------------------------------------

    def make_model(self, rest: str) -> None:
        self.model = rest

    def make_straps(self, rest: str) -> None:
        self.straps |= dict(item.split("=") for item in rest.split())

    def make_options(self, rest: str) -> None:
        self.options |= dict(item.split("=") for item in rest.split())

    def make_timing(self, rest: str) -> None:
        self.timed = rest == "on"

    def make_unpowered(self, rest: str) -> None:
        self.powered = False

    def make_image(self, rest: str) -> None:
        language = catalogue.language(self.model)
        self.images["unit"] = assemble(language, "\n".join(rest.split()), "").image

    def make_units(self, rest: str) -> None:
        self.addresses = {name: int(address) for name, address in (item.split("=") for item in rest.split())}

    def make_toml(self, rest: str) -> None:
        self.toml.append(rest)

    def make(self) -> Cell:
        text = []
        for name in self.addresses or ["unit"]:
            straps = dict(self.straps)
            if self.addresses:
                levels = SELECT[self.addresses[name]]
                straps |= {"SEL2": levels[0], "SEL1": levels[1], "SEL0": levels[2]}
            text += [f"[units.{name}]", f'model = "{self.model}"', f"powered = {str(self.powered).lower()}"]
            text += [f"[units.{name}.straps]", *(f'{pin} = "{level}"' for pin, level in straps.items())]
            text += [f"[units.{name}.options]", *(f'{option} = "{value}"' for option, value in self.options.items())]
        if self.addresses:
            text += ["[lines.bus]", f"units = {list(self.addresses)}"]
        text += self.toml
        return build(
            parse("\n".join(text), "dialogue"),
            lambda file: "",
            images=self.images,
            store=lambda unit, image: self.eeprom_works,
            line_timing=self.timed,
        )

    # -- lines -------------------------------------------------------------------------------------------

    def play(self, lines: list[tuple[int, str]]) -> None:
        for self.number, self.line in lines:
            word, _, rest = self.line.partition(" ")
            action = {">": self.say, "<": self.hear, ">>": self.say_raw, "<<": self.hear_raw}.get(word)
            if action is None:
                action = getattr(self, f"do_{word}", None)
            assert action is not None, f"line {self.number}: there is no such line: {self.line}"
            action(rest)
        self.number, self.line = lines[-1]
        self.nothing_left()

    def check(self, truth: bool, message: str) -> None:
        assert truth, f"line {self.number}, {self.line!r} (at {self.cell.now} ns): {message}"

    def checksum(self, data: bytes) -> bytes:
        """The datasheet's: sum of the characters, seven bits, ORed with 10h from V2.2 on."""
        if self.straps.get("CHS") == "0":
            return b""
        total = sum(data) % 128
        return bytes([total if self.options.get("revision") in ("2.1", "1.0") else total | 0x10])

    def say(self, rest: str) -> None:
        data = rest.encode("ascii")
        self.send(data + self.checksum(data) + b"\r")

    def say_raw(self, rest: str) -> None:
        self.send(unescape(rest))

    def send(self, data: bytes) -> None:
        if not self.timed:
            self.nothing_left()
        self.cell.send(0, data)
        self.asked.append(self.cell.lines[0].host_busy_until)
        self.listen()

    def listen(self) -> None:
        for heard in self.cell.lines[0].take():
            self.check(heard.char.parity_ok and heard.char.framing_ok, "the host hears a damaged character")
            self.arrived.append((heard.at, heard.char.value))

    def nothing_left(self) -> None:
        self.listen()
        left = bytes(value for _, value in self.arrived)
        self.check(not left, f"nobody expected the answer {left!r}")

    def next_characters(self, count: int | None) -> tuple[bytes, list[int]]:
        """The next `count` characters, or with None those up to the next CR, and when they came."""
        self.listen()
        while True:
            values = bytes(value for _, value in self.arrived)
            end = values.find(b"\r") + 1 if count is None else count if len(values) >= count else 0
            if end:
                break
            deadline = self.cell.lines[0].deadline if self.timed else LONG_ENOUGH
            self.check(self.timed and deadline < LONG_ENOUGH, f"no answer came, only {values!r}")
            self.cell.run_to(deadline)
            self.listen()
        times = [at for at, _ in self.arrived[:end]]
        del self.arrived[:end]
        return values[:end], times

    def hear(self, rest: str) -> None:
        data, times = self.next_characters(None)
        text = rest.encode("ascii")
        self.check(data == text + self.checksum(text) + b"\r", f"{data!r} came")
        if self.timed:
            self.check_times(times)

    def hear_raw(self, rest: str) -> None:
        wanted = unescape(rest)
        data, _ = self.next_characters(len(wanted))
        self.check(data == wanted, f"{data!r} came")

    def check_times(self, times: list[int]) -> None:
        """Every character takes 11 bit times, from the request's last stop bit or the answer before on."""
        baud = Fraction(self.cell.lines[0].format.baud)

        def ends(start: int, before: int) -> list[int]:
            return [start + round_half_up((before + k) * 11 * SECOND / baud) for k in range(1, len(times) + 1)]

        start, before = self.burst
        possible = [(at, 0) for at in self.asked] + [(start, before)]
        if before:
            possible.append((start + round_half_up(before * 11 * SECOND / baud), 0))
        found = next((base for base in possible if ends(*base) == times), None)
        self.check(found is not None, f"its characters ended at {times}")
        assert found is not None
        self.burst = (found[0], found[1] + len(times))

    # -- what happens ------------------------------------------------------------------------------------

    def do_run(self, rest: str) -> None:
        self.enter(rest)
        self.ask("E")

    def do_store(self, rest: str) -> None:
        self.enter(rest)
        self.ask("M")
        if self.model == "gs-c200s":
            self.ask("Px")

    def enter(self, rest: str) -> None:
        self.ask("Po" if self.model == "gs-c200s" else "P")
        for instruction in rest.split():
            self.ask(instruction)

    def ask(self, command: str) -> None:
        self.say(command)
        self.hear("Y")

    def target(self, name: str) -> tuple[str, str]:
        unit, dot, pin = name.rpartition(".")
        return (unit, pin) if dot else (next(iter(self.addresses), "unit"), pin)

    def do_pin(self, rest: str) -> None:
        name, level = rest.split(" = ")
        self.cell.set_pin(*self.target(name), int(level))

    def do_switch(self, rest: str) -> None:
        name, level = rest.split(" = ")
        self.cell.set_switch(name, int(level))

    def do_power(self, rest: str) -> None:
        state, _, unit = rest.partition(" ")
        self.cell.power(unit or self.target("")[0], state == "on")

    def do_eeprom(self, rest: str) -> None:
        self.eeprom_works = rest == "works"

    def do_mark(self, rest: str) -> None:
        self.marked = self.cell.now
        self.before = {unit: len(self.cell.recording.of(unit)) for unit in self.cell.recording.units}

    def do_wait(self, rest: str) -> None:
        if not self.timed:
            self.nothing_left()
        if rest.startswith("idle"):
            unit, _ = self.target(rest.removeprefix("idle").strip() + "." if rest != "idle" else "")
            self.step_until(lambda: self.level(unit, "RDY") != 0, "it never gets ready")
        elif rest.startswith("pulse "):
            unit, _ = self.target("")
            self.step_until(lambda: self.level(unit, "MOV") == 1, "nothing moves")
            self.cell.run_to(self.last_motion().train.time_of(int(rest.removeprefix("pulse "))))
        else:
            self.cell.run_to(self.cell.now + parse_duration(rest))
        self.listen()

    def step_until(self, reached: Callable[[], bool], complaint: str) -> None:
        for _ in range(MOST_STEPS):
            if reached():
                return
            at = self.cell.step()
            self.check(at is not None and at < LONG_ENOUGH, complaint)
        self.check(False, complaint)

    def last_motion(self, unit: str = "") -> MotionStarted:
        entries = self.cell.recording.of(unit or self.target("")[0])
        motions = [entry for entry in entries if isinstance(entry, MotionStarted)]
        self.check(bool(motions), "there is no motion")
        return motions[-1]

    # -- what must be true -------------------------------------------------------------------------------

    def level(self, unit: str, pin: str) -> int | None:
        return self.watched.levels.get((unit, pin))

    def do_expect(self, rest: str) -> None:
        words = rest.split()
        if len(words) == 3 and words[1] == "=":
            found = self.level(*self.target(words[0]))
            self.check(found == (None if words[2] == "open" else int(words[2])), f"it is {found}")
            return
        if words[0] == "time":
            wanted = self.instant(rest.removeprefix("time "))
            self.check(self.cell.now == wanted, f"it is {self.cell.now} ns and not {wanted}")
            return
        name, what = self.target(words[0])
        status = self.cell.controller(name).status(self.cell.now)
        self.check(str(getattr(status, what)) == words[1], f"it is {status}")

    def instant(self, text: str) -> int:
        return self.marked + parse_duration(text[1:]) if text.startswith("+") else parse_duration(text)

    def edge_times(self, name: str, level: int) -> list[int]:
        unit, pin = self.target(name)
        return [
            entry.at
            for entry in self.cell.recording.of(unit)
            if isinstance(entry, PinSet) and entry.pin == pin and entry.level == level
        ]

    def do_edge(self, rest: str) -> None:
        match = re.fullmatch(r"(\S+) = ([01]) at (.+)", rest)
        assert match, f"line {self.number}: write edge PIN = LEVEL at TIME"
        times = self.edge_times(match[1], int(match[2]))
        self.check(self.instant(match[3]) in times, f"not at {self.instant(match[3])}; it did so at {times}")

    def do_edges(self, rest: str) -> None:
        name, count = rest.split(" = ")
        unit, pin = self.target(name)
        times, level = [], None
        for index, entry in enumerate(self.cell.recording.of(unit)):
            if isinstance(entry, PinSet) and entry.pin == pin:
                if level is not None and index >= self.before.get(unit, 0):
                    times.append(entry.at)
                level = entry.level
            elif isinstance(entry, Powered):
                level = None
        self.check(len(times) == int(count), f"it changed at {times}")

    def do_pulse(self, rest: str) -> None:
        number, _, time = rest.partition(" at ")
        found = self.last_motion().train.time_of(int(number))
        self.check(found == self.instant(time), f"it comes at {found} ns, not at {self.instant(time)}")


def unescape(text: str) -> bytes:
    r"""Bytes of a text with \r, \n, \\ and \xNN."""
    return text.encode("latin-1").decode("unicode_escape").encode("latin-1")


def round_half_up(value: Fraction) -> int:
    return (2 * value.numerator + value.denominator) // (2 * value.denominator)


def play(scene: Scene) -> None:
    """Play one scene; AssertionError with the line where it goes wrong."""
    Player(scene).play(scene.lines)
