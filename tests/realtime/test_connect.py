import asyncio
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

import pytest
from tests.realtime.served import address, served

import detent
from detent.cell.description import parse
from detent.hosts.dcb274 import BlockingDcb274
from detent.hosts.errors import NoAnswer
from detent.hosts.exchange import Progress
from detent.hosts.genstepper import BlockingGenStepper
from detent.hosts.gsc200 import BlockingGsC200
from detent.hosts.supersigma import BlockingSupersigma
from detent.realtime.addresses import PortError
from detent.realtime.connect import HOSTS, connect, connect_async
from detent.realtime.endpoints.spec import EndpointSpec

KINDS = {
    "gs-c200": BlockingGsC200,
    "gs-c200s": BlockingGsC200,
    "supersigma": BlockingSupersigma,
    "dcb-274": BlockingDcb274,
    "bs0610": BlockingGenStepper,
    "bs0710": BlockingGenStepper,
}
WAYS: Sequence[EndpointSpec] = (
    EndpointSpec("pty"),
    EndpointSpec("tcp", "127.0.0.1:0"),
    EndpointSpec("rfc2217", "127.0.0.1:0"),
)


def written(way: EndpointSpec, where: str) -> str:
    return f"rfc2217://{where}" if way.kind == "rfc2217" else where


def test_every_model_has_a_driver() -> None:
    assert set(HOSTS) == set(KINDS)


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.kind)
@pytest.mark.parametrize("model", KINDS)
def test_every_model_is_driven_over_every_kind_of_port(model: str, way: EndpointSpec) -> None:
    with (
        served(model, endpoints=[way]) as service,
        connect(model, written(way, address(service)), patience=10.0) as unit,
    ):
        assert isinstance(unit, KINDS[model])
        unit.move_by(100)
        unit.wait(60.0)
        assert unit.position() == 100


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.kind)
@pytest.mark.parametrize("model", ["gs-c200s", "dcb-274", "bs0610", "supersigma"])
def test_coroutines_drive_them_as_well(model: str, way: EndpointSpec) -> None:
    async def drive(where: str) -> int:
        async with await connect_async(model, where, patience=10.0) as unit:
            await unit.move_by(100)
            await unit.wait(60.0)
            return int(await unit.position())

    with served(model, endpoints=[way]) as service:
        assert asyncio.run(asyncio.wait_for(drive(written(way, address(service))), 120)) == 100


def test_the_modules_of_a_multipoint_line_share_a_port() -> None:
    text = """
    [units.one]
    model = "gs-c200"
    straps = { SEL2 = "low" }
    [units.two]
    model = "gs-c200"
    straps = { SEL1 = "low" }
    [lines.bus]
    units = ["one", "two"]
    """
    with served(parse(text, "cell.toml")) as service, connect("gs-c200", address(service), address=1) as one:
        two = connect("gs-c200", one.port, address=2)
        one.move_by(50)
        two.move_by(70)
        one.wait(60.0)
        two.wait(60.0)
        assert (one.position(), two.position()) == (50, 70)
        three = connect("gs-c200", one.port, address=3, patience=0.05)
        with pytest.raises(NoAnswer, match="GS-C200 at address 3: does not answer"):
            three.position()


def test_the_line_is_that_of_the_model_unless_told_otherwise() -> None:
    with served("gs-c200") as service:
        unit = connect("gs-c200", address(service))
        assert str(unit.port.form) == "9600 7O2"  # "7 data bits, odd parity, 2 stop bits"
        unit.close()
        unit = connect("gs-c200", address(service), baud=1200, parity="none", data_bits=8, stop_bits=1)
        assert str(unit.port.form) == "1200 8N1"
        unit.close()


def test_who_watches_is_told_how_far_a_long_operation_is() -> None:
    told: list[Progress] = []
    with served("gs-c200s") as service, connect("gs-c200s", address(service), watch=told.append) as unit:
        unit.write_program(["A1", "D1", "C1"])
    assert [(step.done, step.total) for step in told] == [(0, 3), (1, 3), (2, 3), (3, 3)]


def test_a_lost_unit_is_found_again_by_its_link(tmp_path: object) -> None:
    link = f"{tmp_path}/stepper"
    with served("gs-c200", endpoints=[EndpointSpec("pty", link)]):
        unit = connect("gs-c200", link)
        assert unit.position() == 0
    with pytest.raises(ConnectionError, match="GS-C200: the port is gone"):
        unit.position()
    with served("gs-c200", endpoints=[EndpointSpec("pty", link)]):
        assert unit.position() == 0
        unit.close()


def test_what_cannot_be_is_refused_before_a_port_is_opened() -> None:
    with pytest.raises(ValueError, match="no model 'gsc200'; did you mean gs-c200"):
        connect("gsc200", "/dev/no-such-device")
    with pytest.raises(ValueError, match="no option of the driver of the gs-c200 'adress'; did you mean address"):
        connect("gs-c200", "/dev/no-such-device", adress=2)  # type: ignore[call-overload]
    with pytest.raises(ValueError, match="an address is 1 to 7"):
        connect("gs-c200", "/dev/no-such-device", address=8)
    with pytest.raises(ValueError, match="parity 'od': choose from none, odd, even"):
        connect("gs-c200", "/dev/no-such-device", parity="od")
    with pytest.raises(ValueError, match="data_bits 9: choose from 5, 6, 7, 8"):
        connect("gs-c200", "/dev/no-such-device", data_bits=9)
    with pytest.raises(ValueError, match="baud 0: a line has bits a second, like 9600"):
        connect("gs-c200", "/dev/no-such-device", baud=0)
    with pytest.raises(ValueError, match="patience -1: a unit needs some time to answer"):
        connect("gs-c200", "/dev/no-such-device", patience=-1)
    with pytest.raises(PortError, match="no such device"):
        connect("gs-c200", "/dev/no-such-device")


def test_detent_has_both_and_importing_it_brings_neither() -> None:
    assert detent.connect is connect
    assert detent.connect_async is connect_async
    with pytest.raises(AttributeError, match="module 'detent' has no attribute 'conect'"):
        detent.conect  # type: ignore[attr-defined]  # noqa: B018
    program = "import sys, detent; print(any(name.startswith('detent.') for name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


@pytest.mark.parametrize("model", [None, 7, ["gs-c200"], b"gs-c200"])
def test_what_is_no_name_of_a_model_is_told(model: Any) -> None:
    with pytest.raises(ValueError, match="a model is a name, one of gs-c200, gs-c200s"):
        connect(model, "box:4001")
