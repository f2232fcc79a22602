"""The log of a tuning run on a machine: a line of JSON for everything that happened, on disk before the next begins."""

import contextlib
import json
import os
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from detent.realtime.system import lock

MOST_BYTES = 64 << 20  # of a log that is gone on with: years of trials


class LogUnusable(OSError):
    """A file that cannot be the log. The text says why, and what to do."""


class TrialLog:
    """A log that is appended to; `past` are the records that were there.

    A last line that was not written whole (the computer went off in it) is taken off. One process has a log at a time.
    Raises LogUnusable; nothing is changed then.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file = open(path, "a+b")  # noqa: SIM115 - it is closed by close()
        except OSError as error:
            raise LogUnusable(f"{path}: {error.strerror or error}: choose another place with --log FILE") from None
        try:
            self.past = self._read()
        except BaseException:
            self._file.close()
            raise

    def _read(self) -> list[Mapping[str, Any]]:
        try:
            lock(self._file.fileno())
        except BlockingIOError:
            raise LogUnusable(f"{self.path}: another run writes it: wait for its end, or give another --log") from None
        except OSError:
            pass  # a file system without locks
        self._file.seek(0)
        data = self._file.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            raise LogUnusable(f"{self.path} has more than {MOST_BYTES >> 20} MiB: choose another place with --log FILE")
        whole = data[: data.rfind(b"\n") + 1]
        found: list[Mapping[str, Any]] = []
        for number, line in enumerate(whole.splitlines(), 1):
            try:
                record = json.loads(line)
            except (ValueError, RecursionError):
                record = None
            if not isinstance(record, dict) or (number == 1 and record.get("kind") != "plan"):
                raise LogUnusable(f"{self.path}: line {number} is none of a tuning run: choose another --log FILE")
            found.append(record)
        if not found and data:
            raise LogUnusable(f"{self.path}: it is no log of a tuning run: choose another --log FILE")
        if len(whole) != len(data):
            self._file.truncate(len(whole))
        return found

    def write(self, record: Mapping[str, Any]) -> None:
        """Append a record, with the time of day, and see that it is on disk."""
        stamped = {**record, "at": datetime.now(UTC).isoformat(timespec="milliseconds")}
        self._file.write(json.dumps(stamped).encode() + b"\n")
        self._file.flush()
        with contextlib.suppress(OSError):  # a pipe has no disk
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
