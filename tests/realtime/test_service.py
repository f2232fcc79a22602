import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from detent.cell.description import Problem, parse, single
from detent.realtime.endpoints.endpoint import EndpointError
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.images import Images
from detent.realtime.service import Service, models

TWO_LINES = """
[units.bar]
model = "gs-c200"
straps = { CHS = "low" }
[units.drill]
model = "gs-c200s"
straps = { CHS = "low" }
"""
ONE_LINE = """
[units.bar]
model = "gs-c200"
straps = { SEL2 = "low" }
[units.drill]
model = "gs-c200"
straps = { SEL1 = "low" }
[lines.bus]
units = ["bar", "drill"]
"""


def no_file(name: str) -> str:
    raise FileNotFoundError(name)


@pytest.fixture
def images(tmp_path: Path) -> Iterator[Images]:
    made = Images(tmp_path, "gs-c200", {"gs-c200": "gs-c200"})
    yield made
    made.close()


def test_a_controller_is_served_at_a_pseudo_terminal() -> None:
    with Service(single("gs-c200", straps={"CHS": "low"}), no_file) as service:
        (endpoint,) = service.endpoints
        assert (endpoint.unit, endpoint.kind) == ("gs-c200", "pty")
        client = os.open(endpoint.address, os.O_RDWR | os.O_NOCTTY)
        serving = threading.Thread(target=service.run)
        serving.start()
        os.write(client, b"V1\r")
        answer = b""
        while len(answer) < 3:
            answer += os.read(client, 10)
        service.stop()
        serving.join()
        os.close(client)
        assert answer == b"V0\r"
        assert service.dropped() == 0
        assert service.lateness().deadlines >= 6, "three characters each way"


def test_every_line_of_a_cell_gets_its_own_endpoint(tmp_path: Path) -> None:
    endpoints = [EndpointSpec("pty", str(tmp_path / "x")), EndpointSpec("tcp", "127.0.0.1:0")]
    with Service(parse(TWO_LINES, "two.toml"), no_file, endpoints) as service:
        assert [(e.unit, e.kind) for e in service.endpoints] == [
            ("bar", "pty"),
            ("bar", "tcp"),
            ("drill", "pty"),
            ("drill", "tcp"),
        ]
        assert service.endpoints[0].address == str(tmp_path / "x-bar")
        assert service.endpoints[1].address != service.endpoints[3].address
    assert list(tmp_path.iterdir()) == []


def test_a_line_with_several_units_goes_by_its_own_name() -> None:
    with Service(parse(ONE_LINE, "one.toml"), no_file) as service:
        assert [e.unit for e in service.endpoints] == ["bus"]


def test_the_cell_file_says_where_a_line_is_found(tmp_path: Path) -> None:
    text = f'{ONE_LINE}endpoint = "pty:{tmp_path / "bus"}"\n'
    with Service(parse(text, "one.toml"), no_file) as service:
        assert service.endpoints[0].address == str(tmp_path / "bus")
    with Service(parse(text, "one.toml"), no_file, [EndpointSpec("tcp", "127.0.0.1:0")]) as service:
        assert [e.kind for e in service.endpoints] == ["tcp"], "what is asked for goes before what is written"


def test_a_wrong_endpoint_in_the_cell_file_is_named_with_its_key() -> None:
    with pytest.raises(Problem, match=r"one\.toml: lines\.bus\.endpoint: 'com1' is no endpoint; write pty,"):
        Service(parse(f'{ONE_LINE}endpoint = "com1"\n', "one.toml"), no_file)


def test_when_the_last_endpoint_cannot_be_opened_the_others_are_closed(tmp_path: Path) -> None:
    (tmp_path / "x-drill").touch()
    with pytest.raises(EndpointError):
        Service(parse(TWO_LINES, "two.toml"), no_file, [EndpointSpec("pty", str(tmp_path / "x"))])
    assert [path.name for path in tmp_path.iterdir()] == ["x-drill"]


def test_a_stored_program_is_there_the_next_time(images: Images) -> None:
    description = single("gs-c200", straps={"CHS": "low"})

    def said(service: Service, *lines: str) -> bytes:
        for line in lines:
            service.cell.type("gs-c200", line)
            service.cell.run_to(service.cell.now + 100_000_000)
        return bytes(heard.char.value for heard in service.cell.lines[0].take())

    with Service(description, no_file, images=images) as service:
        said(service, "P", "A1", "C1", "M")
    with Service(description, no_file, images=images) as service:
        assert service.reports == []
        assert said(service, "X", "Q").startswith(b"Y\rA1\rC1\r")


def test_an_image_that_its_controller_refuses_is_moved_aside(images: Images) -> None:
    images.save("gs-c200", b"\xff" * 3)
    with Service(single("gs-c200"), no_file, images=images) as service:
        (report,) = service.reports
        assert "damaged" in report
        assert report.endswith("gs-c200.gs-c200.eeprom.damaged-1 now, and gs-c200 starts empty")


def test_an_image_is_not_blamed_for_another_fault(images: Images) -> None:
    images.save("gs-c200", b"\xff" * 3)
    with pytest.raises(Problem, match="no strap"):
        Service(single("gs-c200", straps={"XX": 1}), no_file, images=images)
    assert images.path("gs-c200").exists()


def test_images_know_their_models() -> None:
    assert models(parse(TWO_LINES, "two.toml")) == {"bar": "gs-c200", "drill": "gs-c200s"}
