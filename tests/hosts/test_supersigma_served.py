"""The SUPERSIGMA's drivers on drives that are served: messages and answers as a stream of bytes."""

import asyncio
from collections.abc import Iterator
from contextlib import closing, contextmanager

import pytest

from detent.cell.description import parse
from detent.hosts.supersigma import AsyncCcu, AsyncSupersigma, BlockingCcu, BlockingSupersigma, Ccu, Supersigma
from detent.realtime.async_ports import open_async_port
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.ports import open_port
from detent.realtime.service import Service

TWO = """
[units.left]
model = "supersigma"
[units.right]
model = "supersigma"
options = { number = 2, short = "free" }
[lines.microbus]
units = ["left", "right"]
"""


@contextmanager
def served(kind: str) -> Iterator[tuple[Service, str]]:
    wanted = [EndpointSpec("tcp", "127.0.0.1:0")] if kind == "tcp" else [EndpointSpec("pty")]
    with Service(parse(TWO, "two"), lambda file: "", wanted, pace=50) as service, service.in_thread():
        yield service, service.endpoints[0].address


def positions(service: Service) -> list[int]:
    cell = service.cell
    return [drive.status(cell.now).position for drive in cell.controllers().values()]


@pytest.mark.parametrize("kind", ["pty", "tcp"])
def test_two_drives_move_at_the_word_of_a_ccu_outside(kind: str) -> None:
    with served(kind) as (service, address), closing(open_port(address)) as port:
        ccu = BlockingCcu(Ccu(patience=5), port)
        reports = ccu.move_all({1: 300, 2: -2600})
        assert {drive: report.steps for drive, report in reports.items()} == {1: 300, 2: 2600}
        ccu.move_line({1: -60, 2: 20})
        right = BlockingSupersigma(Supersigma(2, patience=5), port)
        right.set_position(0)
        right.move_to(500)
        right.wait()
        assert right.position() == 500
    assert positions(service) == [240, -2080]


def test_coroutines_drive_them_too() -> None:
    async def work(address: str) -> None:
        port = await open_async_port(address)
        left, right = (AsyncSupersigma(Supersigma(number, patience=5), port) for number in (1, 2))
        await asyncio.gather(left.move_to(700), right.move_to(-50))
        await asyncio.gather(left.wait(), right.wait())
        await AsyncCcu(Ccu(patience=5), port).move_line({1: -30, 2: 30})
        await port.close()

    with served("pty") as (service, address):
        asyncio.run(work(address))
    assert positions(service) == [670, -20]
