"""What all drivers do alike: stopped by another, on a line that babbles or echoes, beside a unit of another kind."""

import inspect
import random
import re
from collections.abc import Callable, Iterator
from contextlib import nullcontext, suppress
from typing import Any

import pytest
from tests.hosts.modules import cell

from detent.cell.cell import Cell
from detent.cell.host import HostPort
from detent.hosts.axis import Speeds
from detent.hosts.dcb274 import BlockingDcb274, Dcb274
from detent.hosts.errors import BadAnswer, Busy, DriverError, MotionFailed, NoAnswer, PortLost, Refused, Spoken
from detent.hosts.exchange import LONGEST_ANSWER, Blocking, Operation
from detent.hosts.genstepper import BlockingGenStepper, GenStepper
from detent.hosts.gsc200 import BlockingGsC200, GsC200
from detent.hosts.supersigma import BlockingSupersigma, Supersigma
from detent.one_line import MOST

DRIVERS: dict[str, Callable[[Any], Any]] = {
    "gs-c200": lambda port: BlockingGsC200(GsC200("gs-c200"), port),
    "gs-c200s": lambda port: BlockingGsC200(GsC200("gs-c200s"), port),
    "supersigma": lambda port: BlockingSupersigma(Supersigma(1), port),
    "dcb-274": lambda port: BlockingDcb274(Dcb274(), port),
    "bs0610": lambda port: BlockingGenStepper(GenStepper("X"), port),
}
MORE_BABBLE = ["prompts", "letters", "nulls"]
PATIENT = {"gs-c200": 7, "gs-c200s": 7, "supersigma": 3, "dcb-274": 12, "bs0610": 4}
"""Seconds in which a call on a line that babbles is over: its tries, and what it does to clear the line."""


class Elsewhere(HostPort):
    """In the rest between two questions another thread does something, once."""

    def __init__(self, cell: Cell) -> None:
        super().__init__(cell)
        self.then: Callable[[], object] | None = None

    def wait(self, seconds: float) -> None:
        super().wait(seconds)
        then, self.then = self.then, None
        if then is not None:
            then()


def unit_of(model: str) -> tuple[Elsewhere, Any]:
    made = cell(f'[units.unit]\nmodel = "{model}"\n')
    made.run_to(1_000_000_000)
    port = Elsewhere(made)
    return port, DRIVERS[model](port)


@pytest.mark.parametrize("way", ["stop", "halt"])
@pytest.mark.parametrize("model", DRIVERS)
def test_a_wait_is_over_and_no_failure_when_another_thread_stops_the_move(model: str, way: str) -> None:
    port, unit = unit_of(model)
    unit.set_speeds(Speeds(100, 900, 0.2))
    unit.move_by(6000)
    port.then = getattr(unit, way)
    unit.wait(timeout=20)
    assert not unit.moving()
    assert 0 < unit.position() < 6000


@pytest.mark.parametrize("steps", [100, -100, 1])
@pytest.mark.parametrize("before", ["move_by(6000)", "move_to(-6000)", "run_at(900)", "run_at(-900)"])
def test_a_move_told_in_a_stop_arrives_where_the_board_says(before: str, steps: int) -> None:
    _, x = unit_of("bs0610")
    eval(f"x.{before}")
    x.port.wait(1)
    x.stop()
    x.move_by(steps)
    x.wait(timeout=20)
    x.move_to(17)
    x.wait(timeout=20)
    assert x.position() == 17


def test_a_halt_in_a_reversal_does_not_start_the_other_way() -> None:
    """Page 29: at a stop rate of 62500 a reversal needs no stop, so Z has to come first."""
    _, x = unit_of("bs0610")
    x.set_run_rate(8000)
    x.set_slope(2000)
    x.run_at(8000)
    x.port.wait(5)
    x.run_at(-8000)
    assert x.action().name == "REVERSING"
    before = x.position()
    x.halt()
    assert not x.moving()
    assert x.position() > before  # on in the old direction to the stop, and not one step back


def test_the_time_out_of_a_wait_counts_questions_too() -> None:
    made = cell('[units.unit]\nmodel = "gs-c200"\nstraps = { BR0 = "low", BR1 = "low", BR2 = "low" }\n')
    made.run_to(1_000_000_000)
    unit = BlockingGsC200(GsC200(baud=110), HostPort(made))
    unit.run_at(100)
    began = unit.port.clock()
    with pytest.raises(DriverError, match="still moves after 3 s"):
        unit.wait(timeout=3)
    assert unit.port.clock() - began < 5


# -- lines that babble, that echo ------------------------------------------------------------------------------


class Babbling:
    """A port on which something comes all the time, in virtual time; or what is sent comes back."""

    def __init__(self, noise: Iterator[bytes], *, character: float = 1e-3) -> None:
        self.noise, self.character, self.now, self.kept = noise, character, 0.0, b""

    def write(self, data: bytes) -> None:
        self.now += len(data) * self.character

    def receive(self, timeout: float) -> bytes:
        pieces = 512 if timeout <= 0 else 1  # what has come meanwhile
        data, self.kept = self.kept or b"".join(next(self.noise) for _ in range(pieces)), b""
        self.now += min(len(data) * self.character, max(timeout, 0.0)) or 1e-6
        return data

    def keep(self, data: bytes) -> None:
        self.kept = data + self.kept

    def wait(self, seconds: float) -> None:
        self.now += seconds

    def clock(self) -> float:
        return self.now

    def turn(self) -> Any:
        return nullcontext()

    def close(self) -> None:
        pass


class Echoing(Babbling):
    def __init__(self) -> None:
        super().__init__(iter(()))

    def write(self, data: bytes) -> None:
        self.kept += data

    def receive(self, timeout: float) -> bytes:
        data, self.kept = self.kept, b""
        self.now += 0.0 if data else timeout
        return data


def noise(kind: str) -> Iterator[bytes]:
    chance = random.Random(kind)
    while True:
        match kind:
            case "random":
                yield chance.randbytes(chance.randrange(1, 3000))
            case "frames":
                yield (
                    chance.choice([b"Y\r", b"B\r", b"R\r", b"E1\r", b"V1\r", b"+100\r", b"+100\x1c\r", b"R\x12\r"]) * 3
                )
            case "prompts":
                yield chance.choice([b"*", b"X,-8,3\r\n*", b"GenStepper $version: 1$\r\n", b"\r\n*"])
            case "letters":
                yield b"x" * 4096
            case "nulls":
                yield bytes(chance.randrange(1, 640))
            case "lines":
                yield chance.choice([b"#\r\n", b" \r\n", b"X", b"1\r\n", b"\r\n", b"AMS V1.30\r\n", b"\x08"])


ARGUMENTS: dict[str, Any] = {
    "steps": 10, "position": 10, "rate": 100, "speeds": Speeds(100, 900, 0.1), "direction": 1, "lines": ["+100"],
    "text": "X", "count": 2, "output": 1, "input": 1, "seconds": 1.0, "number": -1, "address": 5, "mode": 1,
    "level": 1, "half": True, "slope": 100, "page": 2, "name": "B", "rounds": 2, "inputs": 1, "speed": 600,
    "flags": 8, "value": 1, "timeout": 2.0, "limit": 900, "line": "X",
}  # fmt: skip
LONG = {
    "spool", "name_chain", "scan",  # on lines that this unit is not on
    "trace", "saved", "restore",  # many exchanges, each of them bounded
}  # fmt: skip


def calls(unit: Blocking) -> Iterator[tuple[str, Callable[[], object]]]:
    """Every operation, with arguments that it takes."""
    for name in sorted(dir(type(unit.driver))):
        if name.startswith("_") or name in LONG:
            continue
        if not isinstance(inspect.getattr_static(type(unit.driver), name), Operation):
            continue
        method = getattr(unit, name)
        needed = [
            ARGUMENTS.get(one.name, 1)
            for one in inspect.signature(inspect.getattr_static(type(unit.driver), name)._method).parameters.values()
            if one.default is one.empty and one.name != "self" and one.kind is one.POSITIONAL_OR_KEYWORD
        ]
        if name == "wait":
            needed = [2.0]
        yield name, lambda method=method, needed=needed: method(*needed)


@pytest.mark.parametrize(
    "kind", ["random", "frames", "lines"] + [pytest.param(kind, marks=pytest.mark.slow) for kind in MORE_BABBLE]
)
@pytest.mark.parametrize("model", DRIVERS)
def test_every_call_on_a_line_that_babbles_ends_in_time_with_a_short_error(model: str, kind: str) -> None:
    for name, call in list(calls(DRIVERS[model](Babbling(noise(kind))))):
        port = Babbling(noise(kind))
        unit = DRIVERS[model](port)
        call = dict(calls(unit))[name]
        told = ""
        try:
            call()
        except DriverError as error:
            told = str(error)
        except ValueError:
            continue  # no call of this model, or not with this number
        assert len(told) < 600, name
        assert "\n" not in told
        if name not in ("wait", "wait_idle"):
            assert port.now < (20 if "program" in name or name == "save" else PATIENT[model]), name


# -- a stop, whatever the line says ------------------------------------------------------------------------------

NAMED = {f"dcb-274 {mode}": lambda port, mode=mode: BlockingDcb274(Dcb274("A", mode=mode), port)
         for mode in ("party", "daisy", "sin10")}  # fmt: skip
STOPPED_BY = {
    "gs-c200": (rb"Z|K", 5.5), "gs-c200s": (rb"Z|K", 5.5), "supersigma": (rb"\x01[\x06\x07]", 1.5),
    "dcb-274": (rb"@|\x1b", 6), "bs0610": (rb"XZ", 4), "dcb-274 party": (rb"A[@|]", 1.5),
    "dcb-274 daisy": (rb"A[@|]\n", 2), "dcb-274 sin10": (rb"A[@|]\r", 1.5),
}  # fmt: skip
"""What stops an axis, with all that has to be said with it; seconds in which the call is over where nobody answers."""
WAITS = {
    "dcb-274 party": 0.35,
    "dcb-274 daisy": 1.0,
}  # seconds for the echo of the name; a chain has to have names first
SHORTER = {"dcb-274": 3.5}  # seconds on one that babbles: only a silence may be a ramp


class Overheard(Babbling):
    """What is sent, and when; without noise nobody says a word."""

    def __init__(self, noise: Iterator[bytes] | None) -> None:
        super().__init__(noise or iter(()))
        self.silent = noise is None
        self.sent: list[tuple[float, bytes]] = []

    def write(self, data: bytes) -> None:
        self.sent.append((self.now, data))
        super().write(data)

    def receive(self, timeout: float) -> bytes:
        if not self.silent:
            return super().receive(timeout)
        data, self.kept = self.kept, b""
        self.now += 0.0 if data else max(timeout, 1e-6)
        return data

    def stopped(self, by: bytes) -> float:
        """When what stops an axis was said, all of it, perhaps in pieces."""
        for count in range(1, len(self.sent) + 1):
            if re.search(by, b"".join(data for _, data in self.sent[:count])):
                return self.sent[count - 1][0]
        raise AssertionError("nothing that was sent stops an axis")


@pytest.mark.parametrize("kind", ["silence", "random", "frames", "prompts", "letters", "nulls", "lines"])
@pytest.mark.parametrize("way", ["stop", "halt"])
@pytest.mark.parametrize("model", STOPPED_BY)
def test_what_stops_an_axis_is_said_before_anything_is_waited_for(model: str, way: str, kind: str) -> None:
    by, longest = STOPPED_BY[model]
    for before in ("", "position", "moving"):
        port = Overheard(None if kind == "silence" else noise(kind))
        unit = {**DRIVERS, **NAMED}[model](port)
        if before:
            with suppress(DriverError):
                getattr(unit, before)()
        began = port.now
        port.sent.clear()
        with suppress(DriverError):
            getattr(unit, way)()
        wait = WAITS.get(model, 0.06)
        assert port.stopped(by) - began <= wait, before
        assert port.now - began <= (longest if kind == "silence" else SHORTER.get(model, longest)), before


@pytest.mark.parametrize("kind", [DriverError, NoAnswer, BadAnswer, Refused, Busy, MotionFailed, PortLost])
def test_whatever_a_device_said_an_error_is_one_short_line(kind: type[DriverError]) -> None:
    for what in ("answers " + repr("\xff\x1a" * 30_000), "x\ny" * 500, "\x1b[31m", "\0" * 9):
        error = kind("unit", what, Spoken(b"F\r" * 900, bytes(range(256)) * 200), advice="ask moving() and position()")
        for told in (str(error), error.told, error.what):
            assert len(told) <= MOST
            assert told.isprintable()


def test_an_answer_of_fifty_thousand_characters_is_not_quoted_whole() -> None:
    port = Babbling((b"X" + b"\xa3" * 25_000 + b"\r\n" for _ in iter(int, 1)), character=1e-7)
    with pytest.raises(DriverError) as told:
        DRIVERS["dcb-274"](port).divide(2)
    assert len(str(told.value)) <= MOST


@pytest.mark.parametrize("model", DRIVERS)
def test_a_flood_is_read_no_further_than_an_answer_can_be_long(model: str) -> None:
    port = Babbling((b"x" * 4096 for _ in iter(int, 1)), character=1e-9)
    with pytest.raises(DriverError):
        DRIVERS[model](port).position()
    assert LONGEST_ANSWER == 65_536


@pytest.mark.parametrize("model", DRIVERS)
def test_a_line_that_echoes_is_told_by_whatever_call_comes_first(model: str) -> None:
    for name in ("position", "moving", "stop"):
        with pytest.raises(BadAnswer, match="sends back what it is sent"):
            getattr(DRIVERS[model](Echoing()), name)()


# -- a unit of another kind ------------------------------------------------------------------------------------

KINDS = {"gs-c200": "gs-c200", "gs-c200s": "gs-c200"}  # the two speak alike


@pytest.mark.parametrize("there", DRIVERS)
@pytest.mark.parametrize("model", DRIVERS)
def test_what_another_controller_says_is_no_position(model: str, there: str) -> None:
    if KINDS.get(model, model) == KINDS.get(there, there):
        return
    made = cell(f'[units.unit]\nmodel = "{there}"\n')
    made.run_to(1_000_000_000)
    unit = DRIVERS[model](HostPort(made))
    for _ in range(3):
        with pytest.raises(DriverError):
            unit.position()
        with pytest.raises(DriverError):
            unit.moving()
