"""EEPROM images on disk: what a unit keeps while it is off, one file for each unit.

A file is written whole or not at all, and the image before it is kept as ``.old``. One that is damaged is moved aside,
never used and never overwritten; one of another model gets the name of that, and its unit finds it again when it is
such a model once more. One process at a time has the images of a cell: a lock beside them says so.

Layout, numbers big-endian: ``89 44 54 4E 54 0D 0A 1A``, version (2 bytes), length of the model's name (2),
length of the image (4), the name in UTF-8, the image, CRC-32 of everything before (4).
"""

import contextlib
import hashlib
import os
import stat
import struct
import sys
import zlib
from collections.abc import Callable, Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import NamedTuple, Self

from detent.realtime.image_names import SUFFIX, claim, safe
from detent.realtime.kept import read_kept
from detent.realtime.system import NO_LINK, lock

MOST_BYTES = 1 << 20  # of a file: the memories of the controllers have thousands
REMEDY = "choose another place with --state DIR"
MAGIC = b"\x89DTNT\r\n\x1a"
VERSION = 1
_HEAD = struct.Struct(">8sHHI")
_CRC = struct.Struct(">I")


class ImagesUnusable(OSError):
    """The images of a cell cannot be kept where they should be. The text says why and what to do."""


class ImageUnreadable(ValueError):
    """A file that is no whole image of this model. The text says what is wrong with it."""


class OtherModel(ImageUnreadable):
    """A whole image, of another model."""

    def __init__(self, written_by: str, model: str) -> None:
        super().__init__(f"it belongs to a {written_by}, not a {model}")
        self.written_by = written_by


class Loaded(NamedTuple):
    """The images that were kept, by unit, and a line of text about each that was moved, aside or back."""

    images: dict[str, bytes]
    reports: list[str]


def default_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Where images are kept if nobody says otherwise: ``$XDG_STATE_HOME/detent`` or ``~/.local/state/detent``."""
    chosen = environment.get("XDG_STATE_HOME", "")
    # a relative path there is to be ignored, says the XDG specification
    base = Path(chosen) if os.path.isabs(chosen) else Path("~/.local/state").expanduser()
    return base / "detent"


def cell_name(target: str, *, is_file: bool) -> str:
    """A name for what is kept of a cell, other than its images, which `image_names` names.

    A model gives its own name. A cell file gives its stem and eight digits made of its absolute path, so that
    two files of one name share nothing.
    """
    if not is_file:
        return safe(target)
    path = Path(target).resolve()
    return f"{safe(path.stem)}-{hashlib.sha256(os.fsencode(path)).hexdigest()[:8]}"


class Images:
    """The images of the cell called `cell` in `folder`; `models` are the units with their models' names."""

    def __init__(
        self,
        folder: Path,
        cell: str,
        models: Mapping[str, str],
        *,
        warn: Callable[[str], None] = lambda text: print(f"detent: {text}", file=sys.stderr, flush=True),
        reports: Sequence[str] = (),
    ) -> None:
        """Take the images into possession. Raises ImagesUnusable. `reports` are told with what `load` finds."""
        self._models = dict(models)
        self._reports = list(reports)
        self._paths = {unit: folder / f"{cell}.{safe(unit)}{SUFFIX}" for unit in models}
        for path in self._paths.values():
            _check_kind(path)
        self._warn = warn
        self._warned: set[Path] = set()
        self._lock = _locked(folder, folder / f"{cell}.lock")

    @classmethod
    def of(cls, folder: Path, target: str, models: Mapping[str, str], *, is_file: bool) -> Self:
        """The images of a cell file, found again when it was moved, or of a model. Raises ImagesUnusable."""
        try:
            found = claim(folder, target, models, is_file=is_file)
        except OSError as error:
            raise ImagesUnusable(f"EEPROM images cannot be kept in {folder}: {error.strerror}; {REMEDY}") from error
        return cls(folder, found.name, models, reports=found.reports)

    def path(self, unit: str) -> Path:
        """The file of a unit."""
        return self._paths[unit]

    def load(self) -> Loaded:
        """Read what is there. What is no image is moved aside, and its unit starts empty.

        What the system does not let be read may be a good image: ImagesUnusable, and nothing is changed.
        """
        found = Loaded({}, self._reports)
        self._reports = []
        for unit, path in self._paths.items():
            model = self._models[unit]
            try:
                try:
                    found.images[unit] = unpack(read_kept(path, MOST_BYTES + 1), model)
                except OtherModel as other:
                    found.reports.append(self._set_apart(unit, other))
                    found.images[unit] = self._taken_back(unit, found.reports)
                except FileNotFoundError:
                    found.images[unit] = self._taken_back(unit, found.reports)
            except FileNotFoundError:
                continue
            except OSError as error:
                raise ImagesUnusable(
                    f"the EEPROM image {path} cannot be read: {error.strerror or error}; mend that, move it away to "
                    f"begin with an empty memory, or {REMEDY}"
                ) from error
            except ImageUnreadable as error:
                found.reports.append(self.set_aside(unit, str(error)))
        return found

    def _of_model(self, unit: str, model: str) -> Path:
        """Where the image of a unit waits that is another model now."""
        path = self._paths[unit]
        return path.with_name(f"{path.name.removesuffix(SUFFIX)}.{safe(model)}{SUFFIX}")

    def _set_apart(self, unit: str, other: OtherModel) -> str:
        """Give the image of another model the name of that; return a line about it."""
        path, apart = self._paths[unit], self._of_model(unit, other.written_by)
        if os.path.lexists(apart):  # somebody put one there: it is an older one
            apart.rename(_unused(apart, "old"))
        path.rename(apart)
        return f"{path}: {other}; it is {apart} now, and is used again when {unit} is a {other.written_by}"

    def _taken_back(self, unit: str, reports: list[str]) -> bytes:
        """The image that the unit kept when it was this model before. Raises FileNotFoundError."""
        path, apart = self._paths[unit], self._of_model(unit, self._models[unit])
        image = unpack(read_kept(apart, MOST_BYTES + 1), self._models[unit])
        apart.rename(path)
        reports.append(f"{apart} is {path} again: {unit} is a {self._models[unit]}")
        return image

    def set_aside(self, unit: str, why: str) -> str:
        """Move a damaged image out of the way, under the next free number; return a line about it."""
        path = self._paths[unit]
        aside = _unused(path, "damaged")
        try:
            path.rename(aside)
        except OSError as error:
            return f"{path}: {why}; it cannot be moved aside ({error.strerror}), and {unit} starts empty"
        old = path.with_name(f"{path.name}.old")
        hint = f"; {old} is the image before it: rename it to use it" if old.is_file() else ""
        return f"{path}: {why}; it is {aside} now, and {unit} starts empty{hint}"

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


def image_in(data: bytes, model: str) -> bytes:
    """The image in a file that holds one as it is, or packed as it is kept here. Raises ImageUnreadable."""
    return unpack(data, model) if data.startswith(MAGIC) else data


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
        raise OtherModel(written_by, model)
    return body[_HEAD.size + name_length :]


def _unused(path: Path, what: str) -> Path:
    """`path` with the first number behind it that nothing has."""
    return next(p for n in count(1) if not os.path.lexists(p := path.with_name(f"{path.name}.{what}-{n}")))


def _check_kind(path: Path) -> None:
    """Raise ImagesUnusable for what is no file that an image could be: it would be waited for, or read for ever."""
    try:
        found = path.lstat()
    except OSError:
        return
    kinds = {stat.S_IFIFO: "a pipe", stat.S_IFLNK: "a symbolic link", stat.S_IFSOCK: "a socket",
             stat.S_IFCHR: "a device", stat.S_IFBLK: "a device", stat.S_IFDIR: "a folder"}  # fmt: skip
    what = kinds.get(stat.S_IFMT(found.st_mode), "")
    if not what and found.st_size > MOST_BYTES:
        what = f"a file of {found.st_size} bytes"
    if what:
        raise ImagesUnusable(f"{path} is {what} and no EEPROM image: move it away, or {REMEDY}")


def _locked(folder: Path, path: Path) -> int:
    """The descriptor of the locked file `path`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | NO_LINK, 0o666)
    except OSError as error:
        raise ImagesUnusable(f"EEPROM images cannot be kept in {folder}: {error.strerror}; {REMEDY}") from error
    try:
        lock(descriptor)
    except BlockingIOError as error:
        os.close(descriptor)
        raise ImagesUnusable(f"{path} is locked: another process serves these units; end it, or {REMEDY}") from error
    except OSError as error:
        os.close(descriptor)
        raise ImagesUnusable(f"{path} cannot be locked: {error.strerror}; {REMEDY}") from error
    return descriptor


def _write_whole(path: Path, data: bytes) -> None:
    """Make `data` the content of `path`, also across a power failure: the file is the old one or the new one.

    The one before it stays as ``.old``. Nobody else writes here (the lock), so what an earlier failure has left under a
    temporary name is removed; no link is followed.
    """
    temporary, older = path.with_name(f"{path.name}.new"), path.with_name(f"{path.name}.older")
    try:
        for left in (temporary, older):
            left.unlink(missing_ok=True)
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | NO_LINK, 0o666)
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        with contextlib.suppress(OSError):  # the first image, or a file system without such links
            os.link(path, older, follow_symlinks=False)
        os.replace(temporary, path)
    except OSError:
        for left in (temporary, older):
            with contextlib.suppress(OSError):
                left.unlink()
        raise
    # the image is in place: from here on nothing is a failure of the save
    with contextlib.suppress(OSError):
        os.replace(older, path.with_name(f"{path.name}.old"))
    with contextlib.suppress(OSError):  # a file system that cannot do more is what it is
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
