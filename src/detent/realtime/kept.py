"""Files that are kept for a cell in a folder of ours: no link is followed, and nothing is waited for."""

import os
from pathlib import Path

from detent.realtime.system import NO_LINK, NO_WAIT


def read_kept(path: Path, most: int) -> bytes:
    """The first `most` bytes of a file. Raises OSError, also for a link; a pipe to which nobody writes is empty."""
    with open(path, "rb", buffering=0, opener=_open) as file:
        parts = []
        while most > 0 and (part := file.read(min(most, 1 << 20))):
            parts.append(part)
            most -= len(part)
    return b"".join(parts)


def _open(path: str, flags: int) -> int:
    return os.open(path, flags | NO_LINK | NO_WAIT)
