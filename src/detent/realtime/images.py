"""EEPROM images on disk: what a unit keeps while it is off, one file for each unit.

A file is written whole or not at all. One that is damaged is moved aside, never used and never overwritten.
One process at a time has the images of a cell: a lock beside them says so.

Layout, numbers big-endian: ``89 44 54 4E 54 0D 0A 1A``, version (2 bytes), length of the model's name (2),
length of the image (4), the name in UTF-8, the image, CRC-32 of everything before (4).
"""

import contextlib
import fcntl
import hashlib
import os
import re
import struct
import sys
import zlib
from collections.abc import Callable, Mapping
from itertools import count
from pathlib import Path
from typing import NamedTuple

MAGIC = b"\x89DTNT\r\n\x1a"
VERSION = 1
_HEAD = struct.Struct(">8sHHI")
_CRC = struct.Struct(">I")


class ImagesUnusable(OSError):
    """The images of a cell cannot be kept where they should be. The text says why and what to do."""


class ImageUnreadable(ValueError):
    """A file that is no whole image of this model. The text says what is wrong with it."""


class Loaded(NamedTuple):
    """The images that were kept, by unit, and a line of text about each that was moved aside."""

    images: dict[str, bytes]
    reports: list[str]


def default_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Where images are kept if nobody says otherwise: ``$XDG_STATE_HOME/detent`` or ``~/.local/state/detent``."""
    chosen = environment.get("XDG_STATE_HOME", "")
    # a relative path there is to be ignored, says the XDG specification
    base = Path(chosen) if os.path.isabs(chosen) else Path("~/.local/state").expanduser()
    return base / "detent"


def cell_name(target: str, *, is_file: bool) -> str:
    """The name that the images of a cell begin with.

    A model gives its own name. A cell file gives its stem and eight digits made of its absolute path, so that
    two files of one name do not share images; a file that is moved starts with empty ones.
    """
    if not is_file:
        return _safe(target)
    path = Path(target).resolve()
    return f"{_safe(path.stem)}-{hashlib.sha256(os.fsencode(path)).hexdigest()[:8]}"


class Images:
    """The images of the cell called `cell` in `folder`; `models` are the units with their models' names."""

    def __init__(
        self,
        folder: Path,
        cell: str,
        models: Mapping[str, str],
        *,
        warn: Callable[[str], None] = lambda text: print(f"detent: {text}", file=sys.stderr, flush=True),
    ) -> None:
        """Take the images into possession. Raises ImagesUnusable."""
        self._models = dict(models)
        self._paths = {unit: folder / f"{cell}.{_safe(unit)}.eeprom" for unit in models}
        self._warn = warn
        self._warned: set[Path] = set()
        self._lock = _locked(folder, folder / f"{cell}.lock")

    def path(self, unit: str) -> Path:
        """The file of a unit."""
        return self._paths[unit]

    def load(self) -> Loaded:
        """Read what is there. What cannot be read is moved aside, and its unit starts empty."""
        found = Loaded({}, [])
        for unit, path in self._paths.items():
            try:
                found.images[unit] = unpack(path.read_bytes(), self._models[unit])
            except FileNotFoundError:
                continue
            except OSError as error:
                found.reports.append(self.set_aside(unit, error.strerror or str(error)))
            except ImageUnreadable as error:
                found.reports.append(self.set_aside(unit, str(error)))
        return found

    def set_aside(self, unit: str, why: str) -> str:
        """Move a damaged image out of the way, under the next free number; return a line about it."""
        path = self._paths[unit]
        aside = next(p for n in count(1) if not os.path.lexists(p := path.with_name(f"{path.name}.damaged-{n}")))
        try:
            path.rename(aside)
        except OSError as error:
            return f"{path}: {why}; it cannot be moved aside ({error.strerror}), and {unit} starts empty"
        return f"{path}: {why}; it is {aside} now, and {unit} starts empty"

    def save(self, unit: str, image: bytes) -> bool:
        """Keep `image`; False if that failed, and then the old one is still there. Warns once for each file."""
        path = self._paths[unit]
        try:
            _write_whole(path, pack(image, self._models[unit]))
        except OSError as error:
            if path not in self._warned:
                self._warned.add(path)
                self._warn(f"{path}: not written: {error.strerror or error}; the image before it is kept")
            return False
        self._warned.discard(path)
        return True

    def close(self) -> None:
        """Let another process have them. May be called twice."""
        if self._lock >= 0:
            os.close(self._lock)  # the file stays: removing it would let two processes lock two files of one name
            self._lock = -1


def pack(image: bytes, model: str) -> bytes:
    """The content of the file of an image."""
    name = model.encode()
    data = _HEAD.pack(MAGIC, VERSION, len(name), len(image)) + name + image
    return data + _CRC.pack(zlib.crc32(data))


def unpack(data: bytes, model: str) -> bytes:
    """The image in the content of a file. Raises ImageUnreadable."""
    if data[: len(MAGIC)] != MAGIC:
        raise ImageUnreadable("it is no EEPROM image of Detent")
    if len(data) < _HEAD.size + _CRC.size:
        raise ImageUnreadable("it is cut short")
    _, version, name_length, image_length = _HEAD.unpack_from(data)
    if version != VERSION:
        raise ImageUnreadable(f"it has version {version}, and only version {VERSION} is known here")
    expected = _HEAD.size + name_length + image_length + _CRC.size
    if len(data) != expected:
        raise ImageUnreadable(f"it has {len(data)} bytes instead of {expected}")
    body = data[: -_CRC.size]
    if zlib.crc32(body) != _CRC.unpack(data[-_CRC.size :])[0]:
        raise ImageUnreadable("its checksum is wrong")
    written_by = body[_HEAD.size : _HEAD.size + name_length].decode("utf-8", "replace")
    if written_by != model:
        raise ImageUnreadable(f"it belongs to a {written_by}, not a {model}")
    return body[_HEAD.size + name_length :]


def _safe(name: str) -> str:
    """`name` as part of a file name; a name that had to be changed is told apart by digits made of it."""
    safe = re.sub(r"[^A-Za-z0-9_-]", "_", name)[:64]
    return safe if safe == name else f"{safe}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def _locked(folder: Path, path: Path) -> int:
    """The descriptor of the locked file `path`."""
    remedy = "choose another place with --state DIR"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    except OSError as error:
        raise ImagesUnusable(f"EEPROM images cannot be kept in {folder}: {error.strerror}; {remedy}") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(descriptor)
        raise ImagesUnusable(f"{path} is locked: another process serves these units; end it, or {remedy}") from error
    except OSError as error:
        os.close(descriptor)
        raise ImagesUnusable(f"{path} cannot be locked: {error.strerror}; {remedy}") from error
    return descriptor


def _write_whole(path: Path, data: bytes) -> None:
    """Make `data` the content of `path`, also across a power failure: the file is the old one or the new one.

    Nobody else writes here (the lock), so a temporary file of an earlier failure may be overwritten.
    """
    temporary = path.with_name(f"{path.name}.new")
    try:
        with open(temporary, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    with contextlib.suppress(OSError):  # the image is in place; a file system that cannot do more is what it is
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
