from pathlib import Path

import pytest

from detent.realtime.endpoints.spec import EndpointSpec
from detent.uart import Format

FORM = Format(9600)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("pty", EndpointSpec("pty")),
        ("pty:/tmp/drill", EndpointSpec("pty", "/tmp/drill")),
        ("tcp:127.0.0.1:0", EndpointSpec("tcp", "127.0.0.1:0")),
        ("tcp:[::1]:4001", EndpointSpec("tcp", "[::1]:4001")),
        ("rfc2217:127.0.0.1:4002", EndpointSpec("rfc2217", "127.0.0.1:4002")),
        ("serial:/dev/ttyUSB0", EndpointSpec("serial", "/dev/ttyUSB0")),
    ],
)
def test_an_endpoint_is_read_as_a_cell_file_has_it(text: str, wanted: EndpointSpec) -> None:
    assert EndpointSpec.parse(text) == wanted


@pytest.mark.parametrize("text", ["", "tcp", "serial:", "udp:1", "/dev/ttyS0", "tcp:4001", "rfc2217:4001"])
def test_what_is_no_endpoint_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(ValueError, match="; write "):
        EndpointSpec.parse(text)


def test_of_several_lines_each_gets_its_own() -> None:
    assert EndpointSpec("pty").of_several(1, "b") == EndpointSpec("pty")
    assert EndpointSpec("pty", "/tmp/x").of_several(1, "b") == EndpointSpec("pty", "/tmp/x-b")
    assert EndpointSpec("tcp", "127.0.0.1:0").of_several(1, "b") == EndpointSpec("tcp", "127.0.0.1:0")
    assert EndpointSpec("rfc2217", "127.0.0.1:4001").of_several(1, "b") == EndpointSpec("rfc2217", "127.0.0.1:4002")
    assert EndpointSpec("tcp", "[::1]:4001").of_several(2, "c") == EndpointSpec("tcp", "[::1]:4003")


def test_what_cannot_be_shared_out_is_refused() -> None:
    with pytest.raises(ValueError, match="no port is left for line b; begin lower"):
        EndpointSpec("tcp", "127.0.0.1:65535").of_several(1, "b")
    with pytest.raises(ValueError, match="one wire and the cell has several lines"):
        EndpointSpec("serial", "/dev/ttyS0").of_several(0, "a")


@pytest.mark.parametrize("text", ["pty", "tcp:127.0.0.1:0", "rfc2217:127.0.0.1:0"])
def test_it_opens_what_it_names(text: str) -> None:
    wanted = EndpointSpec.parse(text)
    endpoint = wanted.open("drill", FORM)
    assert endpoint.kind == wanted.kind
    assert endpoint.address
    endpoint.close()


def test_a_link_is_made_where_it_is_wanted(tmp_path: Path) -> None:
    endpoint = EndpointSpec("pty", str(tmp_path / "drill")).open("drill", FORM)
    assert (tmp_path / "drill").is_symlink()
    endpoint.close()
