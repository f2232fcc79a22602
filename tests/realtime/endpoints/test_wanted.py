from pathlib import Path

import pytest

from detent.realtime.endpoints.wanted import Wanted
from detent.uart import Format

FORM = Format(9600)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("pty", Wanted("pty")),
        ("pty:/tmp/drill", Wanted("pty", "/tmp/drill")),
        ("tcp:127.0.0.1:0", Wanted("tcp", "127.0.0.1:0")),
        ("tcp:[::1]:4001", Wanted("tcp", "[::1]:4001")),
        ("rfc2217:127.0.0.1:4002", Wanted("rfc2217", "127.0.0.1:4002")),
        ("serial:/dev/ttyUSB0", Wanted("serial", "/dev/ttyUSB0")),
    ],
)
def test_an_endpoint_is_read_as_a_cell_file_has_it(text: str, wanted: Wanted) -> None:
    assert Wanted.parse(text) == wanted


@pytest.mark.parametrize("text", ["", "tcp", "serial:", "udp:1", "/dev/ttyS0", "tcp:4001", "rfc2217:4001"])
def test_what_is_no_endpoint_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(ValueError, match="; write "):
        Wanted.parse(text)


def test_of_several_lines_each_gets_its_own() -> None:
    assert Wanted("pty").of_several(1, "b") == Wanted("pty")
    assert Wanted("pty", "/tmp/x").of_several(1, "b") == Wanted("pty", "/tmp/x-b")
    assert Wanted("tcp", "127.0.0.1:0").of_several(1, "b") == Wanted("tcp", "127.0.0.1:0")
    assert Wanted("rfc2217", "127.0.0.1:4001").of_several(1, "b") == Wanted("rfc2217", "127.0.0.1:4002")
    assert Wanted("tcp", "[::1]:4001").of_several(2, "c") == Wanted("tcp", "[::1]:4003")


def test_what_cannot_be_shared_out_is_refused() -> None:
    with pytest.raises(ValueError, match="no port is left for line b; begin lower"):
        Wanted("tcp", "127.0.0.1:65535").of_several(1, "b")
    with pytest.raises(ValueError, match="one wire and the cell has several lines"):
        Wanted("serial", "/dev/ttyS0").of_several(0, "a")


@pytest.mark.parametrize("wanted", [Wanted("pty"), Wanted("tcp", "127.0.0.1:0"), Wanted("rfc2217", "127.0.0.1:0")])
def test_it_opens_what_it_names(wanted: Wanted) -> None:
    endpoint = wanted.open("drill", FORM)
    assert endpoint.kind == wanted.kind
    assert endpoint.address
    endpoint.close()


def test_a_link_is_made_where_it_is_wanted(tmp_path: Path) -> None:
    endpoint = Wanted("pty", str(tmp_path / "drill")).open("drill", FORM)
    assert (tmp_path / "drill").is_symlink()
    endpoint.close()
