"""Texts that people write: cell files, programs. Read whole, as UTF-8, and never more than a text of theirs can be."""

import errno
import io
import os
import select
import stat
from pathlib import Path
from typing import Final

from detent.realtime.system import NO_WAIT

PIPE: Final = 5.0  # seconds in which something comes through a pipe, or it ends
MOST_BYTES = 16 * 1024 * 1024


def read_whole(path: Path, most: int = MOST_BYTES) -> bytes:
    """The bytes of a file, or of a pipe. Raises OSError, also for one that has more than `most`, or never ends.

    A pipe to which nobody writes is not waited for.
    """
    descriptor = os.open(path, os.O_RDONLY | NO_WAIT | getattr(os, "O_BINARY", 0))
    try:
        file = os.fdopen(descriptor, "rb", closefd=False)
        if stat.S_ISFIFO(os.fstat(descriptor).st_mode):
            if not select.select([descriptor], [], [], PIPE)[0]:
                raise OSError(errno.EAGAIN, "it is a pipe, and nobody writes to it")
            os.set_blocking(descriptor, True)
        data = file.read(most + 1)
    except OSError as error:  # of a descriptor the system does not say which file it is
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        os.close(descriptor)
    if len(data) > most:
        raise OSError(errno.EFBIG, f"it is larger than {most >> 20} MiB: no file that is meant here is", str(path))
    return data


def read_text(path: Path) -> str:
    """The text of a file, its lines ended by a newline each, without the mark that some editors put before UTF-8.

    Raises OSError, whose `strerror` says what is wrong and what to do, also for a file that is no text, or too long
    to be one.
    """
    data = read_whole(path)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line, column = data.count(b"\n", 0, error.start) + 1, error.start - data.rfind(b"\n", 0, error.start)
        raise OSError(
            errno.EILSEQ,
            f"it is no text in UTF-8: byte {data[error.start]:02X} on line {line}, column {column}; save it as UTF-8",
            str(path),
        ) from None
    return io.StringIO(text, newline=None).read()
