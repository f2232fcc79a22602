"""Files that are written whole or not at all, and never in the place of somebody else's."""

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import BinaryIO

MARK = b"Made by detent"
"""What every output carries near its begin or its end, so that the next run may put a newer one in its place."""

_MARKS = (MARK, b"axis,direction,base,interval,count,add")  # the head of a step file is mark enough
_LOOKED_AT = 4096  # bytes at each end


class InTheWay(ValueError):
    """An output that cannot go where it should. The text says what to do."""


def check_outputs(paths: Iterable[Path | None], inputs: Iterable[Path] = (), *, asked: bool = False) -> None:
    """The rule for every file that a verb writes; raises InTheWay before anything is done. None is no file.

    No file takes the place of another unasked: `asked` says that this was asked for, by --overwrite. What a run has
    drawn or recorded itself makes room for a newer one. Whatever is asked, what is read here is not written over, and
    two outputs do not go to one file.
    """
    read, seen = list(inputs), set[Path]()
    for path in paths:
        if path is None:
            continue
        try:
            path.exists()
        except OSError as error:  # a name that is too long
            raise InTheWay(f"{path}: cannot write it: {error.strerror}") from None
        if any(path.exists() and one.exists() and path.samefile(one) for one in read):
            raise InTheWay(f"{path} is read here, and would be lost: write to another file")
        if path.resolve() in seen:
            raise InTheWay(f"{path}: two outputs cannot go to one file: give each its own")
        seen.add(path.resolve())
        if not path.parent.is_dir():
            raise InTheWay(f"{path}: cannot write it: there is no folder {path.parent}")
        if path.is_dir():
            raise InTheWay(f"{path}: cannot write it: it is a folder; name a file in it")
        if path.is_file() and not asked and not _is_ours(path):
            raise InTheWay(f"{path} is there: write to another file, or over it with --overwrite")


def _is_ours(path: Path) -> bool:
    with path.open("rb") as file:
        begin = file.read(_LOOKED_AT)
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - _LOOKED_AT, 0))
        ends = begin + file.read()
    return not size or any(mark in ends for mark in _MARKS)


def write_whole(path: Path, data: bytes, *, follow: bool = True) -> None:
    """Make `data` the content of `path`: afterwards the file is the old one or the new one, never a part.

    See :func:`open_whole`, for data that comes in pieces.
    """
    with open_whole(path, follow=follow) as file:
        file.write(data)


@contextmanager
def open_whole(path: Path, *, follow: bool = True) -> Iterator[BinaryIO]:
    """A file to write to; its content becomes that of `path` when the block ends, and never if it raises.

    The data goes to a temporary file in the same folder, is flushed to the disk and takes the name in one
    step; a file that was there gives its permissions, and a link keeps pointing to the file it names. What
    is no regular file (a pipe, a terminal) is written straight, as nothing can be kept whole there. Where it does not
    `follow`, the file takes the place of a link or a pipe itself: so it is in folders that are our own. Raises
    OSError with the name of `path` if it cannot be done; the temporary file is then gone.
    """
    try:
        with _opened(path, follow) as file:
            yield file
    except OSError as error:
        error.filename, error.filename2 = str(path), None
        raise


@contextmanager
def _opened(path: Path, follow: bool) -> Iterator[BinaryIO]:
    if follow and path.exists() and not path.is_file():
        with path.open("wb") as straight:
            yield straight
        return
    target = path.resolve() if follow else path
    mode = target.stat().st_mode & 0o777 if target.is_file() and not (target.is_symlink() and not follow) else None
    temporary, descriptor = _create_beside(target)
    try:
        with os.fdopen(descriptor, "wb") as file:
            if mode is not None:
                temporary.chmod(mode)
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
