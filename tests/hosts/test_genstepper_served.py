"""The driver of a GenStepper board on a served one: over a real pseudo-terminal, as calls and as coroutines."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from detent.cell.description import parse
from detent.hosts.axis import Speeds
from detent.hosts.genstepper import AsyncGenStepper, BlockingGenStepper, GenStepper
from detent.realtime.async_ports import open_async_port
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.ports import open_port
from detent.realtime.service import Service

BOARD = '[units.board]\nmodel = "bs0610"\n'
PATIENCE = 20.0  # this computer may be busy


@contextmanager
def served(line_timing: bool = True) -> Iterator[str]:
    """The address of a board, fifty times as fast as real time."""
    description = parse(BOARD, "board")
    with (
        Service(description, lambda file: "", [EndpointSpec("pty")], pace=50, line_timing=line_timing) as service,
        service.in_thread(),
    ):
        yield service.endpoints[0].address


@pytest.mark.parametrize("line_timing", [True, False])
def test_calls_over_a_pseudo_terminal(line_timing: bool) -> None:
    with served(line_timing) as address:
        port = open_port(address)
        with BlockingGenStepper(GenStepper("X", patience=PATIENCE), port) as x:
            y = BlockingGenStepper(GenStepper("Y", patience=PATIENCE), port)
            x.set_speeds(Speeds(100, 2000, 0.1))
            x.move_to(1000)
            y.move_by(-300)
            x.wait(60)
            y.wait(60)
            assert (x.position(), y.position()) == (1000, -300)
            assert x.restore(x.saved())
            assert x.reset() == "2.18"
            assert x.position() == 0


def test_coroutines_over_a_pseudo_terminal_one_waits_while_the_other_moves() -> None:
    async def both(address: str) -> None:
        port = await open_async_port(address)
        async with AsyncGenStepper(GenStepper("X", patience=PATIENCE), port) as x:
            y = AsyncGenStepper(GenStepper("Y", patience=PATIENCE), port)
            await asyncio.gather(x.move_to(1000), y.move_by(-300))
            await asyncio.gather(x.wait(60), y.wait(60))
            assert await x.position() == 1000
            assert await y.position() == -300
            await x.run_at(-500)
            await x.halt()
            assert not await x.moving()

    with served() as address:
        asyncio.run(both(address))
