"""Files that are written whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import BinaryIO


def write_whole(path: Path, data: bytes) -> None:
    """Make `data` the content of `path`: afterwards the file is the old one or the new one, never a part.

    See :func:`open_whole`, for data that comes in pieces.
    """
    with open_whole(path) as file:
        file.write(data)


@contextmanager
def open_whole(path: Path) -> Iterator[BinaryIO]:
    """A file to write to; its content becomes that of `path` when the block ends, and never if it raises.

    The data goes to a temporary file in the same folder, is flushed to the disk and takes the name in one
    step; a file that was there gives its permissions, and a link keeps pointing to the file it names. What
    is no regular file (a pipe, a terminal) is written straight, as nothing can be kept whole there. Raises
    OSError if it cannot be done; the temporary file is then gone.
    """
    if path.exists() and not path.is_file():
        with path.open("wb") as straight:
            yield straight
        return
    target = path.resolve()
    mode = target.stat().st_mode & 0o777 if target.exists() else None
    temporary, descriptor = _create_beside(target)
    try:
        with os.fdopen(descriptor, "wb") as file:
            if mode is not None:
                os.fchmod(descriptor, mode)
            yield file
            file.flush()
            os.fsync(descriptor)
        temporary.replace(target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    _flush_folder(target.parent)


def _create_beside(target: Path) -> tuple[Path, int]:
    """A new file in the folder of `target` under a name that nobody has, open for writing."""
    for number in count():
        temporary = target.with_name(f".{target.name}.{os.getpid()}.{number}")
        try:
            return temporary, os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        except FileExistsError:
            continue
    raise AssertionError("count() has no end")


def _flush_folder(folder: Path) -> None:
    """Make the new name survive a power failure too."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
