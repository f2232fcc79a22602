"""The driver of the GS-C200 on served modules: over a real pseudo-terminal, as calls and as coroutines."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager

from detent.cell.description import parse
from detent.hosts.axis import Speeds
from detent.hosts.gsc200 import AsyncGsC200, BlockingGsC200, GsC200
from detent.realtime.async_ports import open_async_port
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.ports import open_port
from detent.realtime.service import Service

TWO = """
[units.left]
model = "gs-c200s"
straps = { SEL2 = 0, SEL1 = 1, SEL0 = 1 }
[units.right]
model = "gs-c200s"
straps = { SEL2 = 1, SEL1 = 0, SEL0 = 1 }
[lines.both]
units = ["left", "right"]
"""
PATIENCE = 20.0  # this computer may be busy


@contextmanager
def served() -> Iterator[str]:
    """The address of the line of two modules, fifty times as fast as real time."""
    with Service(parse(TWO, "two"), lambda file: "", [EndpointSpec("pty")], pace=50) as service, service.in_thread():
        yield service.endpoints[0].address


def modules() -> tuple[GsC200, GsC200]:
    return tuple(GsC200("gs-c200s", address=number, patience=PATIENCE) for number in (1, 2))  # type: ignore[return-value]


def test_calls_over_a_pseudo_terminal() -> None:
    with served() as address:
        port = open_port(address, baud=9600, data_bits=7, parity="odd", stop_bits=2)
        first, second = modules()
        with BlockingGsC200(first, port) as left:
            right = BlockingGsC200(second, port)
            assert left.set_speeds(Speeds(200, 5000, 0.1)) == Speeds(200, 5000, 520 / 5200)
            left.move_to(-1000)
            right.write_program(["S100", "T1000", "L0", "A1", "+10", "C1", "L3"])
            right.save()
            right.execute()
            left.wait(180)
            right.wait(180)
            assert (left.position(), right.position()) == (-1000, 30)
            saved = right.saved()
            assert saved["program"] == ["S100", "T1000", "L0", "A1", "+10", "C1", "L3"]
            assert left.restore(saved)
            assert left.read_program() == saved["program"]


def test_coroutines_over_a_pseudo_terminal_one_waits_while_the_other_moves() -> None:
    async def both(address: str) -> None:
        port = await open_async_port(address, baud=9600, data_bits=7, parity="odd", stop_bits=2)
        first, second = modules()
        async with AsyncGsC200(first, port) as left:
            right = AsyncGsC200(second, port)
            await left.set_speeds(Speeds(200, 5000, 0.1))
            await asyncio.gather(left.move_to(2000), right.move_by(-5))
            await asyncio.gather(left.wait(180), right.wait(180))
            assert await left.position() == 2000
            assert await right.position() == -5
            await left.run_at(-3000)
            await left.stop()
            await left.wait(180)
            assert await left.position() < 2000

    with served() as address:
        asyncio.run(both(address))
