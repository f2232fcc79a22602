"""Units that the workbench talks to: looks, lines, hands, STOP; units that stall, babble, lie, or are unplugged."""

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

import pytest
from tests.workbench.patience import PATIENCE
from tests.workbench.told import alone

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.host import HostPort
from detent.hosts.dcb274 import BlockingDcb274, Dcb274
from detent.hosts.errors import DriverError, Refused
from detent.hosts.genstepper import BlockingGenStepper, GenStepper
from detent.hosts.gsc200 import BlockingGsC200, GsC200
from detent.hosts.supersigma import BlockingSupersigma, Supersigma
from detent.hosts.typed import say
from detent.realtime.connect import HOSTS
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.service import Service
from detent.workbench.folder import Folder
from detent.workbench.live import Live, Value
from detent.workbench.messages import EndpointPicture
from detent.workbench.stopping import StopFailed, Stopping
from detent.workbench.units import beside
from detent.workbench.units.asked import look
from detent.workbench.units.registry import Units
from detent.workbench.units.unit import UnitBusy, options_of

pytestmark = pytest.mark.waits

DRIVERS: dict[str, Callable[[HostPort], Any]] = {
    "gs-c200": lambda port: BlockingGsC200(GsC200(), port),
    "gs-c200s": lambda port: BlockingGsC200(GsC200("gs-c200s"), port),
    "dcb-274": lambda port: BlockingDcb274(Dcb274(), port),
    "bs0610": lambda port: BlockingGenStepper(GenStepper("X"), port),
    "bs0710": lambda port: BlockingGenStepper(GenStepper("Y"), port),
    "supersigma": lambda port: BlockingSupersigma(Supersigma(1), port),
}
QUESTIONS = ("X\r", "^\r", "Z\r", "]0\r", " ", "\b")  # of a DCB-274, its sign-on, and BS, which empties the line


class Told(HostPort):
    """A port that remembers what was sent."""

    def __init__(self, cell: Cell) -> None:
        super().__init__(cell)
        self.sent = b""

    def write(self, data: bytes) -> int:
        self.sent += data
        return super().write(data)


def emulated(model: str) -> tuple[Cell, Told, Any]:
    cell = build(parse(f'[units.unit]\nmodel = "{model}"\n', "cell"), lambda file: "")
    port = Told(cell)
    return cell, port, DRIVERS[model](port)


@pytest.mark.parametrize("model", DRIVERS)
def test_a_look_tells_where_an_axis_is_and_moves_nothing(model: str) -> None:
    cell, _, unit = emulated(model)
    for _ in range(3):
        seen = unit.perform(look(unit.driver))
    assert (seen.position, seen.moving) == (0, False)
    assert all(not one.status(cell.now, axis).position for one in cell.controllers().values() for axis in one.axes)
    unit.move_to(4000)
    seen = unit.perform(look(unit.driver))
    assert seen.moving
    if model.startswith("gs-c200"):  # while it is busy it answers F, Z and K alone
        assert seen.position is None
        assert all(fact.value is None for fact in seen.facts)
    unit.wait()
    assert unit.perform(look(unit.driver)).position == 4000


def test_a_look_at_a_dcb_274_says_nothing_but_questions() -> None:
    _, port, unit = emulated("dcb-274")
    for _ in range(3):
        unit.perform(look(unit.driver))
    said = port.sent.decode("latin-1")
    for question in QUESTIONS:
        said = said.replace(question, "")
    assert said == ""


def test_a_look_at_a_dcb_274_that_runs_a_program_leaves_it_alone() -> None:
    _, _, unit = emulated("dcb-274")
    unit.write_program(["+ 2000", "W 0", "- 2000", "W 0"])
    unit.go()
    seen = unit.perform(look(unit.driver))
    assert (seen.position, seen.moving) == (None, None)
    unit.wait()
    assert unit.position() == 0


PROGRAMS = {  # lines that a person types, how they are listed, and what ends program mode
    "gs-c200": (["P", "+100", "D1"], ["+100", "D1"], "E"),
    "gs-c200s": (["Po", "+100", "D1"], ["+100", "D1"], "Px"),
    "dcb-274": (["P 0", "+ 100", "W 0"], ["+ 100", "W 0"], "P"),
}


@pytest.mark.parametrize("model", PROGRAMS)
def test_looks_between_the_lines_of_a_program_that_is_typed_store_nothing(model: str) -> None:
    cell, port, unit = emulated(model)
    lines, _, ends = PROGRAMS[model]
    for line in lines:
        assert not unit.perform(say(unit.driver, line)).refused
        assert unit.driver.programming
        before, port.sent = port.sent, b""
        for _ in range(3):
            seen = unit.perform(look(unit.driver))
            assert seen.state == "program mode: what is sent is stored"
        if model == "dcb-274":  # it stores whatever it is sent
            assert port.sent == b""
            assert seen.position is None
        else:  # F and V are obeyed at once
            assert seen.position == 0
        port.sent = before + port.sent
    typed = cell.controller("unit").program_memory()
    assert not unit.perform(say(unit.driver, ends)).refused
    assert not unit.driver.programming
    if model != "gs-c200":  # whose E starts it
        assert unit.perform(look(unit.driver)).position == 0
    other, _, alone = emulated(model)
    for line in lines:
        alone.perform(say(alone.driver, line))
    assert typed == other.controller("unit").program_memory()


@pytest.mark.parametrize("leave", ["stop", "abort", "reset"])
def test_a_unit_that_is_stopped_out_of_program_mode_is_looked_at_again(leave: str) -> None:
    _, _, unit = emulated("dcb-274")
    unit.perform(say(unit.driver, "P 0"))
    unit.perform(getattr(unit.driver, leave)())
    assert unit.perform(look(unit.driver)).state == "at rest"


@pytest.mark.parametrize("model", ["gs-c200", "dcb-274", "bs0610"])
def test_a_look_at_a_unit_without_supply_is_an_error_and_no_figure(model: str) -> None:
    cell, _, unit = emulated(model)
    cell.power("unit", False)
    with pytest.raises(DriverError):
        unit.perform(look(unit.driver))


def test_options_are_written_as_people_write_them() -> None:
    assert options_of("name=X baud=4800 checksums=no") == {
        "name": "X", "baud": 4800, "checksums": False, "mode": "party"
    }  # fmt: skip
    for wrong in ("name", "baud=fast", "name="):
        with pytest.raises(ValueError, match=wrong):
            options_of(wrong)


# -- in real time, against what is served -------------------------------------------------------------------------


class Shown(Live):
    """A table for whoever waits for its next change."""

    def __init__(self) -> None:
        super().__init__()
        self._put = asyncio.Event()

    def put(self, values: Mapping[str, Value]) -> None:
        super().put(values)
        self._put.set()

    async def changed(self) -> None:
        self._put.clear()
        await self._put.wait()


class Desk:
    """Units as windows have them."""

    def __init__(self, folder: Path) -> None:
        self.live = Shown()
        self.stopping = Stopping(self.live)
        self.units = Units(self.live, self.stopping, Folder(folder), folder / "state")

    def facts(self, name: str) -> Any:
        return self.live.get(f"r.{name}")

    async def until(self, name: str, condition: Callable[[Any], bool]) -> Any:
        while not ((facts := self.facts(name)) and condition(facts)):
            await self.live.changed()
        return facts


def after_each(what: Any, call: str) -> asyncio.Event:
    """Set whenever the method `call` of `what` was called."""
    called, done = asyncio.Event(), getattr(what, call)

    def tell(*arguments: Any) -> Any:
        found = done(*arguments)
        called.set()
        return found

    setattr(what, call, tell)
    return called


def at_desk(folder: Path, scene: Callable[[Desk], Awaitable[None]]) -> None:
    async def whole() -> None:
        desk = Desk(folder)
        try:
            await asyncio.wait_for(scene(desk), PATIENCE)
        finally:
            await desk.units.close()

    asyncio.run(whole())


@contextmanager
def served(model: str, pace: int = 20) -> Iterator[str]:
    text = f'[units.unit]\nmodel = "{model}"\n'
    with (
        Service(parse(text, "cell"), lambda file: "", [EndpointSpec("pty")], pace=pace) as service,
        service.in_thread(),
    ):
        yield service.endpoints[0].address


@asynccontextmanager
async def strange(
    answer: Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]],
) -> AsyncIterator[str]:
    """A port at which something else than a unit lives."""
    server = await asyncio.start_server(answer, "127.0.0.1", 0)
    async with server:
        yield f"127.0.0.1:{server.sockets[0].getsockname()[1]}"


@pytest.mark.parametrize("model", ["gs-c200", "dcb-274", "bs0610"])
def test_hands_in_the_commands_of_the_controller(tmp_path: Path, model: str) -> None:
    async def scene(desk: Desk) -> None:
        name = await desk.units.unit_connect(
            model, address, "motor=X patience=2" if model == "bs0610" else "patience=2"
        )
        await desk.until(name, lambda facts: facts["position"] == 0)
        sent = await desk.units.unit_move(name, "jog", 250)
        assert any("250" in line for line in sent), sent
        await desk.until(name, lambda facts: facts["position"] == 250 and not facts["moving"])
        await desk.units.unit_move(name, "zero")
        await desk.until(name, lambda facts: facts["position"] == 0)
        await desk.units.unit_move(name, "go", 70)
        await desk.until(name, lambda facts: facts["position"] == 70 and not facts["moving"])
        await desk.units.unit_hold(name, 200.0)  # and its window is never heard of again
        facts = await desk.until(name, lambda facts: facts["outcome"])
        assert facts["outcome"] == "stops by its ramp"
        await desk.until(name, lambda facts: facts["position"] is not None and facts["position"] > 70)

    with served(model) as address:
        at_desk(tmp_path, scene)


@pytest.mark.parametrize("model", ["gs-c200", "dcb-274", "bs0610"])
def test_a_key_that_is_held_in_two_windows_is_let_go_when_neither_is_heard_of(tmp_path: Path, model: str) -> None:
    """The second is told that the unit is busy, or that it does not take another rate while it moves."""

    async def scene(desk: Desk) -> None:
        name = await desk.units.unit_connect(
            model, address, "motor=X patience=2" if model == "bs0610" else "patience=2"
        )
        await desk.until(name, lambda facts: facts["position"] == 0)
        held = [desk.units.unit_hold(name, rate) for rate in (200.0, 300.0)]
        _, second = await asyncio.gather(*held, return_exceptions=True)
        assert isinstance(second, UnitBusy)
        if model == "gs-c200":
            with pytest.raises(Refused):  # T is not taken while it moves
                await desk.units.unit_hold(name, 400.0)
        facts = await desk.until(name, lambda facts: facts["outcome"])
        assert facts["outcome"] == "stops by its ramp"
        await desk.until(name, lambda facts: facts["position"] and not facts["moving"])

    with served(model) as address:
        at_desk(tmp_path, scene)


def test_a_key_that_is_held_without_an_answer_is_let_go(tmp_path: Path) -> None:
    """The unit may have understood: its answer was damaged, and the window does not say that the key is held."""

    async def damaged(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there, back = await asyncio.open_connection(*address.rsplit(":", 1))
        asked = bytearray()

        async def answers() -> None:
            while data := await there.read(100):
                writer.write(b"?" * len(data) if b"G+" in asked and b"Z" not in asked else data)

        answering = asyncio.create_task(answers())
        while data := await reader.read(100):
            asked.extend(data)
            back.write(data)
        answering.cancel()
        back.close()
        writer.close()

    async def scene(desk: Desk) -> None:
        async with strange(damaged) as port:
            name = await desk.units.unit_connect("gs-c200", port, "patience=0.4")
            await desk.until(name, lambda facts: facts["position"] == 0)
            with pytest.raises(DriverError):
                await desk.units.unit_hold(name, 200.0)
            facts = await desk.until(name, lambda facts: facts["outcome"])
            assert facts["outcome"] == "stops by its ramp"
            await desk.until(name, lambda facts: facts["position"] and not facts["moving"])
            await desk.units.close()

    text = '[units.unit]\nmodel = "gs-c200"\n'
    endpoints = [EndpointSpec("tcp", "127.0.0.1:0")]
    with Service(parse(text, "cell"), lambda file: "", endpoints) as service, service.in_thread():
        address = service.endpoints[0].address
        at_desk(tmp_path, scene)


def test_the_same_line_to_two_units(tmp_path: Path) -> None:
    async def scene(desk: Desk) -> None:
        names = [await desk.units.unit_connect("gs-c200", address) for address in (first, second)]
        told = await desk.units.unit_both(names, "V1")
        assert [one["answers"] for one in told] == [("V0",), ("V0",)]
        assert all(one["ms"] > 0 for one in told)  # type: ignore[operator]
        told = await desk.units.unit_both(names, "nonsense")
        assert all(one["refused"] for one in told)

    with served("gs-c200") as first, served("gs-c200") as second:
        at_desk(tmp_path, scene)


def test_program_and_backup(tmp_path: Path) -> None:
    async def scene(desk: Desk) -> None:
        name = await desk.units.unit_connect("dcb-274", address, "patience=2")
        told = await desk.units.unit_store(name, "+ 500\nW 0\n", save=False)
        assert told.startswith("2 instructions")
        assert await desk.units.unit_compare(name, "+ 500\nW 0\n") == []
        assert await desk.units.unit_compare(name, "+ 501\nW 0\n")
        source = await desk.units.unit_source(name)
        assert source.startswith("+ 500\nW 0\n")
        assert "\n; left of an older program at 8-" in source, "the factory's is longer"
        with pytest.raises(ValueError, match="no command"):
            await desk.units.unit_store(name, "nonsense\n")
        assert await desk.units.unit_backup(name, "kept.toml") == "kept.toml"
        with pytest.raises(FileExistsError):
            await desk.units.unit_backup(name, "kept.toml")
        await desk.units.unit_store(name, "- 7\n")
        seen = await desk.units.unit_differs(name, "kept.toml")
        assert seen["lines"]
        with pytest.raises(ValueError, match="changed since"):
            await desk.units.unit_restore(name, "kept.toml", "something else")
        told_lines = await desk.units.unit_restore(name, "kept.toml", str(seen["seen"]))
        assert Path(told_lines[-1].split()[-1]).is_file()
        assert await desk.units.unit_compare(name, "+ 500\nW 0\n") == []

    with served("dcb-274", pace=100) as address:
        at_desk(tmp_path, scene)


def test_the_time_of_an_answer_is_not_that_of_others_on_the_line(tmp_path: Path) -> None:
    """Two addresses at one port: nobody answers at the first, for which the second has to wait."""

    async def scene(desk: Desk) -> None:
        names = [await desk.units.unit_connect("gs-c200", address, f"patience=2 address={n}") for n in (1, 2)]
        there = [name for name in names if await desk.until(name, lambda facts: facts["trouble"] or facts["state"])
                 and not desk.facts(name)["trouble"]]  # fmt: skip
        assert len(there) == 1
        begin = time.monotonic()
        both: Any = await desk.units.unit_both(sorted(names, key=lambda name: name in there), "V1")
        silent, answered = both
        assert (silent["ms"], answered["answers"]) == (None, ("V0",))
        whole = 1000 * (time.monotonic() - begin)
        assert answered["ms"] <= whole - 2000, "without the two seconds that the other kept the line"

    text = '[units.unit]\nmodel = "gs-c200"\nstraps = { SEL0 = "high", SEL1 = "low", SEL2 = "high" }\n'
    endpoints = [EndpointSpec("tcp", "127.0.0.1:0")]
    with Service(parse(text, "cell"), lambda file: "", endpoints) as service, service.in_thread():
        address = service.endpoints[0].address
        at_desk(tmp_path, scene)


@pytest.mark.parametrize(("model", "begin", "end"), [("gs-c200s", "Po", "Px"), ("dcb-274", "P 0", "P")])
def test_a_hand_moves_nothing_into_a_program_that_is_typed(tmp_path: Path, model: str, begin: str, end: str) -> None:
    async def scene(desk: Desk) -> None:
        name = await desk.units.unit_connect(model, address)
        await desk.until(name, lambda facts: facts["position"] == 0)
        await desk.units.unit_say(name, begin)
        for move in (desk.units.unit_move(name, "jog", 10), desk.units.unit_move(name, "zero"),
                     desk.units.unit_hold(name, 100.0)):  # fmt: skip
            with pytest.raises(ValueError, match=rf"program mode: a command would be stored, and nothing move; {end}"):
                await move
        await desk.units.unit_say(name, end)
        await desk.units.unit_move(name, "jog", 10)
        await desk.until(name, lambda facts: facts["position"] == 10)

    with served(model) as address:
        at_desk(tmp_path, scene)


def test_stop_comes_before_what_is_pending(tmp_path: Path) -> None:
    """The line I of a GenStepper board is answered when the motor stands (manual, page 27): STOP does not wait."""

    async def scene(desk: Desk) -> None:
        name = await desk.units.unit_connect("bs0610", address, "motor=X patience=2")
        pending = asyncio.create_task(desk.units.unit_say(name, "+SI"))
        facts = await desk.until(name, lambda facts: facts["job"])
        with pytest.raises(UnitBusy, match="under way"):
            await desk.units.unit_say(name, "X")
        heard = after_each(desk.units._units[name].tap.transcript, "take")
        while "'command', 'I'" not in str((await desk.units.unit_talk(name))["rows"]):
            heard.clear()
            await heard.wait()
        assert (await desk.stopping.stop_all())[0].startswith(name)
        with pytest.raises(UnitBusy, match="broken off"):
            await pending
        facts = await desk.until(name, lambda facts: facts["moving"] is False)
        assert facts["position"] is not None

    with served("bs0610", pace=1) as address:
        at_desk(tmp_path, scene)


SHARED = {  # a line that several share: what is said of each of them, and the lines that let them run on
    "gs-c200": ('straps = { SEL2 = 0, SEL1 = 1, SEL0 = 1 }', 'straps = { SEL2 = 1, SEL1 = 0, SEL0 = 1 }',
                'straps = { SEL2 = 0, SEL1 = 0, SEL0 = 1 }'),
    "dcb-274": ('options = { name = "A" }', 'options = { name = "B" }', 'options = { name = "C" }'),
    "bs0610": ("",),
}  # fmt: skip
REACHED = {"gs-c200": ("address=1", "address=2", "address=3"), "dcb-274": ("name=A", "name=B", "name=C"),
           "bs0610": ("motor=X", "motor=Y")}  # fmt: skip
RUN = {"gs-c200": ("T300", "G+"), "dcb-274": ("M300",), "bs0610": ("300R", "900000G")}


@contextmanager
def shared(model: str) -> Iterator[tuple[str, Cell]]:
    """Units of `model` on one line: where it is, and their cell."""
    names = "abc"[: len(SHARED[model])]
    text = "".join(
        f'[units.{name}]\nmodel = "{model}"\n{more}\n' for name, more in zip(names, SHARED[model], strict=True)
    )
    text += f"[lines.bus]\nunits = {list(names)}\n".replace("'", '"')
    endpoints = [EndpointSpec("tcp", "127.0.0.1:0")]
    with Service(parse(text, "cell"), lambda file: "", endpoints) as service, service.in_thread():
        yield service.endpoints[0].address, service.cell


def axes(cell: Cell) -> list[str]:
    """How each axis of a cell stands, in a word."""
    return [unit.status(cell.now, axis).state for unit in cell.controllers().values() for axis in unit.axes]


def test_a_line_to_a_motor_of_a_board_is_for_that_motor(tmp_path: Path) -> None:
    async def scene(desk: Desk) -> None:
        names = [await desk.units.unit_connect("bs0610", address, f"patience=5 {where}") for where in REACHED["bs0610"]]
        for at, name in enumerate(names):
            for other in names:  # whichever was asked last is the one that the board has chosen
                await desk.units.unit_say(other, "-1?")
            await desk.units.unit_say(name, f"{100 + at}GI")
        for at, name in enumerate(names):
            await desk.until(name, lambda facts, at=at: facts["position"] == 100 + at)  # type: ignore[misc]

    with shared("bs0610") as (address, _):
        at_desk(tmp_path, scene)


@pytest.mark.parametrize("presses", [1, 2])
@pytest.mark.parametrize("model", SHARED)
def test_stop_stops_each_unit_of_a_line_that_several_share(tmp_path: Path, model: str, presses: int) -> None:
    async def scene(desk: Desk) -> None:
        names = [await desk.units.unit_connect(model, address, f"patience=5 {where}") for where in REACHED[model]]
        for name in names:
            for line in RUN[model]:
                told = await desk.units.unit_say(name, line)
                assert not told["refused"], told
        for name in names:
            await desk.until(name, lambda facts: facts["moving"])
        told_all = await asyncio.gather(*(desk.stopping.stop_all() for _ in range(presses)))
        assert [len(told) for told in told_all] == [len(names)] * presses
        words = "stops by its ramp" if presses == 1 else "stopped at once"
        assert [one.rpartition(": ")[2] for one in told_all[-1]] == [words] * len(names)
        for name in names:
            await desk.until(name, lambda facts: facts["moving"] is False)
            assert desk.facts(name)["outcome"] == words

    with shared(model) as (address, cell):
        at_desk(tmp_path, scene)
        assert set(axes(cell)) == {"ready"}


def test_a_unit_that_is_dead_delays_no_stop_of_others_on_its_line(tmp_path: Path) -> None:
    async def scene(desk: Desk) -> None:
        dead, living = [await desk.units.unit_connect("gs-c200", address, f"patience=1 address={n}") for n in (7, 2)]
        await desk.until(dead, lambda facts: facts["trouble"])
        await desk.until(living, lambda facts: facts["state"] and not facts["trouble"])
        for line in RUN["gs-c200"]:
            await desk.units.unit_say(living, line)
        over = []
        stops = [asyncio.create_task(desk.units.unit_stop(name)) for name in (dead, living)]
        for stop, name in zip(stops, (dead, living), strict=True):
            stop.add_done_callback(lambda _, name=name: over.append(name))  # type: ignore[misc]
        told = await asyncio.gather(*stops, return_exceptions=True)
        assert over == [living, dead]
        assert isinstance(told[0], StopFailed)
        assert told[1] == "stops by its ramp"

    with shared("gs-c200") as (address, _):
        at_desk(tmp_path, scene)


def test_behind_a_stop_no_line_is_said_of_those_that_were_to_be_said_together(tmp_path: Path) -> None:
    """Settings and a move from the page Motion: the move must not follow a STOP that came between."""

    async def scene(desk: Desk) -> None:
        name = await desk.units.unit_connect("bs0610", address, "motor=X patience=5")
        sent = asyncio.create_task(desk.units.unit_lines(name, ["2000G", "I", "0G"]))
        await desk.until(name, lambda facts: facts["job"])
        heard = after_each(desk.units._units[name].tap.transcript, "take")
        while "'command', 'I'" not in str((await desk.units.unit_talk(name))["rows"]):
            heard.clear()
            await heard.wait()
        await desk.stopping.stop_all()
        with pytest.raises(UnitBusy, match="broken off by a stop"):
            await sent
        said = str((await desk.units.unit_talk(name))["rows"])
        assert said.count("'command', 'G'") == 1, "the line behind it was said"
        told = await desk.units.unit_lines(name, ["100R", "7000O", "5G"])
        assert [one["refused"] for one in told] == [False, True]

    with served("bs0610", pace=1) as address:
        at_desk(tmp_path, scene)


@pytest.mark.parametrize("model", ["gs-c200", "dcb-274", "bs0610", "supersigma"])
def test_a_unit_that_stalls_is_unknown_and_stop_says_that_it_was_not_confirmed(tmp_path: Path, model: str) -> None:
    async def stall(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while await reader.read(100):
            pass
        writer.close()

    async def scene(desk: Desk) -> None:
        async with strange(stall) as address:
            name = await desk.units.unit_connect(model, address, "patience=0.02")
            facts = await desk.until(name, lambda facts: facts["trouble"])
            assert facts["position"] is None
            assert facts["state"] is None
            with pytest.raises(StopFailed, match="switch off the supply"):
                await desk.stopping.stop_all()
            await desk.units.close()

    at_desk(tmp_path, scene)


@pytest.mark.parametrize("model", ["gs-c200", "dcb-274", "bs0610"])
def test_a_unit_that_babbles_or_lies_is_unknown(tmp_path: Path, model: str) -> None:
    async def babble(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while data := await reader.read(100):
            writer.write(b"\xffV+1\x00x" + data[::-1] + b"~")
        writer.close()

    async def scene(desk: Desk) -> None:
        async with strange(babble) as address:
            name = await desk.units.unit_connect(model, address, "patience=0.02")
            facts = await desk.until(name, lambda facts: facts["trouble"])
            assert facts["position"] is None
            await desk.units.close()

    at_desk(tmp_path, scene)


def test_a_port_that_is_lost_shows_at_once_and_is_spoken_to_only_when_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    came: list[asyncio.StreamWriter] = []
    heard = bytearray()

    async def listen(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        came.append(writer)
        while data := await reader.read(100):
            heard.extend(data)

    async def scene(desk: Desk) -> None:
        async with strange(listen) as address:
            name = await desk.units.unit_connect("gs-c200", address, "patience=0.02")
            await desk.until(name, lambda facts: facts["trouble"])
            await desk.units.unit_asking(name, True)
            came[0].close()
            facts = await desk.until(name, lambda facts: facts["lost"])
            assert facts["position"] is None
            before = bytes(heard)
            paused, sleep = asyncio.Event(), asyncio.sleep

            async def told(seconds: float) -> None:
                await sleep(seconds)
                paused.set()

            monkeypatch.setattr(asyncio, "sleep", told)
            with pytest.raises(UnitBusy, match="port is gone"):
                await desk.units.unit_say(name, "V1")
            for _ in range(3):  # three times it could have looked at the port
                paused.clear()
                await paused.wait()
            assert (len(came), bytes(heard)) == (1, before)
            await desk.units.unit_again(name)
            assert not desk.facts(name)["lost"]
            await desk.until(name, lambda facts: len(heard) > len(before))
            await desk.units.close()
            for writer in came:
                writer.close()

    at_desk(tmp_path, scene)


@pytest.mark.parametrize("model", DRIVERS)
def test_every_model_of_a_cell_can_be_connected_to_as_its_host_does(model: str) -> None:
    told = alone(model)
    line = next(iter(told.picture.lines.values()))
    served = line._replace(endpoints=(EndpointPicture("pty", "/tmp/port"),))
    found = beside.emulated(told.picture._replace(lines={line.name: served}))
    assert {one.model for one in found} == {model}
    for one in found:
        assert one.address == "/tmp/port"
        assert set(options_of(one.options)) <= {*HOSTS[model].options, "baud"}
