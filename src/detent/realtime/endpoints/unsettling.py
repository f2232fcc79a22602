"""The processes that unsettle pseudo-terminals (`unsettler`), as whoever serves them has them."""

import socket
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import subprocess

_PATIENCE = 1.0  # s


class Unsettling:
    """The processes, for any number of terminals. Where they cannot be had, whoever serves the terminals is slower."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._line: socket.socket | None = None

    def watch(self, ours: int) -> bool:
        """Unsettle the terminal of which `ours` is the end of whoever serves it, until `close`; whether it is so."""
        with suppress(OSError):
            if self._line is None:
                self._start()
            if self._line is not None:
                socket.send_fds(self._line, [b"\0"], [ours])
                return True
        return False

    def _start(self) -> None:
        script = Path(__file__).with_name("unsettler.py")
        if not sys.platform.startswith("linux") or not sys.executable or not script.is_file():
            return
        import subprocess  # only who serves a terminal needs it

        self._line, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-S", str(script)],
                stdin=theirs.fileno(),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C is for whoever serves
            )

    def close(self) -> None:
        """End them: no terminal stays open because of them. May be called twice."""
        if self._line is not None:
            self._line.close()
            self._line = None
        if self._process is not None:
            import subprocess

            try:
                self._process.wait(_PATIENCE)  # they end with the line
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            self._process = None
