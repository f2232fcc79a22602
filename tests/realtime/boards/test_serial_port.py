"""The device of a board: what cannot be opened is told in a line, and one that goes away is tried again."""

import errno
import fcntl
import os
import termios
from collections.abc import Callable
from typing import Any

import pytest

from detent.realtime.boards.port import PortError
from detent.realtime.boards.ports import SerialPort, open_port

OPENS = (
    (os, "open"),
    (os, "set_blocking"),
    (termios, "tcgetattr"),
    (termios, "tcsetattr"),
    (fcntl, "flock"),
    (fcntl, "ioctl"),
)


def test_ports_that_cannot_be_opened(tmp_path: Any) -> None:
    with pytest.raises(PortError, match="cannot be opened: No such file"):
        open_port(str(tmp_path / "nothing"))
    (tmp_path / "file").write_text("")
    with pytest.raises(PortError, match="is no serial device"):
        open_port(str(tmp_path / "file"))
    with pytest.raises(PortError, match="no such fake board"):
        open_port("fake:fast")


def test_a_port_belongs_to_one_program() -> None:
    ours, theirs = os.openpty()
    try:
        first = open_port(os.ttyname(theirs))
        with pytest.raises(PortError, match="in use by another program"):
            open_port(os.ttyname(theirs))
        first.close()
        open_port(os.ttyname(theirs)).close()
    finally:
        os.close(ours)
        os.close(theirs)


@pytest.mark.parametrize("error", [FileNotFoundError(errno.ENOENT, "No such file"), OSError(errno.EIO, "I/O error")])
def test_a_device_that_goes_away_while_it_is_opened_again_is_tried_once_more(
    error: OSError, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever call to the system fails then: no descriptor is closed twice, and none is left open."""
    ours, theirs = os.openpty()
    port = SerialPort(os.ttyname(theirs))
    monkeypatch.setattr(os.path, "realpath", lambda path: "/dev/ttyACM0")  # so that its speed is set, too
    opened: list[int] = []
    calls, fails = 0, 1

    def failing(function: Callable[..., Any]) -> Callable[..., Any]:
        def called(*given: Any, **more: Any) -> Any:
            nonlocal calls
            calls += 1
            if calls == fails:
                raise error
            found = function(*given, **more)
            if function is opens:
                opened.append(found)
            return found

        return called

    def close(descriptor: int) -> None:
        opened.remove(descriptor)
        closes(descriptor)

    opens, closes = os.open, os.close
    port.close()
    for owner, name in OPENS:
        monkeypatch.setattr(owner, name, failing(getattr(owner, name)))
    monkeypatch.setattr(os, "close", close)
    while not port.reopen():
        assert calls >= fails
        assert not opened
        calls, fails = 0, fails + 1
    assert fails > 6
    assert len(opened) == 1
    port.close()
    assert not opened
    closes(ours)
    closes(theirs)
