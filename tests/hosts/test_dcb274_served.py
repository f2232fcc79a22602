"""The DCB-274's driver on a unit that is served on a pseudo-terminal: with calls and with coroutines."""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from detent.cell.description import parse
from detent.hosts.dcb274 import AsyncDcb274, BlockingDcb274, Dcb274
from detent.hosts.errors import MotionFailed
from detent.realtime.async_ports import open_async_port
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.ports import open_port
from detent.realtime.service import Service

SINGLE = '[units.unit]\nmodel = "dcb-274"\n'
PARTY = "".join(
    f'[units.{name}]\nmodel = "dcb-274"\noptions = {{ name = "{name.upper()}" }}\nstraps = {{ PARTY = "high" }}\n'
    for name in "xy"
) + '[lines.bus]\nunits = ["x", "y"]\n'  # fmt: skip


@contextmanager
def served(text: str, pace: int = 20) -> Iterator[str]:
    with (
        Service(parse(text, "cell"), lambda file: "", [EndpointSpec("pty")], pace=pace) as service,
        service.in_thread(),
    ):
        yield service.endpoints[0].address


def test_calls_on_a_served_unit_and_a_stop_from_another_thread() -> None:
    with served(SINGLE) as address, BlockingDcb274(Dcb274(patience=1), open_port(address)) as unit:
        assert unit.connect() == "V1.10"
        unit.move_to(1000)
        unit.wait()
        assert unit.position() == 1000
        assert unit.write_program(["+ 5", "W 0"])[0].text == "+ 5"
        unit.go()
        unit.wait()
        assert unit.position() == 1005
        unit.run_at(1000)
        begun, failed = threading.Event(), []

        def move_on() -> None:
            begun.set()
            try:
                unit.wait()
            except MotionFailed as error:
                failed.append(error)

        waiting = threading.Thread(target=move_on)
        waiting.start()
        begun.wait()
        unit.stop()  # is not behind the wait
        waiting.join()
        assert not failed
        assert unit.position() > 1005


def test_coroutines_on_two_axes_of_a_served_party_line() -> None:
    async def work(address: str) -> tuple[int, int]:
        port = await open_async_port(address)
        x, y = (AsyncDcb274(Dcb274(name, mode="party", patience=1), port) for name in "XY")
        await asyncio.gather(x.move_to(700), y.move_by(-300))
        await asyncio.gather(x.wait(), y.wait())
        places = await asyncio.gather(x.position(), y.position())
        with pytest.raises(ValueError, match="programs are listed in single mode only"):
            await x.listing()
        await port.close()
        return places

    with served(PARTY) as address:
        assert asyncio.run(work(address)) == [700, -300]
