"""Which EEPROM images in a folder are those of a cell: they are found again when its file is moved or renamed.

The images of a cell are `NAME.UNIT.eeprom`. NAME is the stem of its file, with a number where another cell has it;
`NAME.cell` beside them says in words whose they are: the path of the cell file, which file that was on its disk, and
the units with their models. People may edit it.
"""

import hashlib
import os
import re
import time
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import NamedTuple

from detent.controllers.catalogue import MODELS
from detent.realtime.kept import read_kept
from detent.realtime.system import NO_LINK, lock
from detent.toml import written

SUFFIX = ".eeprom"
PATIENCE = 5.0  # seconds for another process that looks for a name, which takes milliseconds
_MOST_OWNER = 1 << 20  # bytes of a NAME.cell
_HEAD = "# Whose EEPROM images these are: the files of this name with .UNIT.eeprom. Cell moved: its path here.\n"


class Owner(NamedTuple):
    """What a `NAME.cell` says."""

    name: str
    path: str
    file: str  # device and inode
    units: str  # unit and model, in order of their names


class Claim(NamedTuple):
    """The NAME of a cell, and what there is to tell about it."""

    name: str
    reports: list[str]


def claim(folder: Path, target: str, models: Mapping[str, str], *, is_file: bool) -> Claim:
    """The name under which `folder` keeps the images of a cell; a model gives its own. Raises OSError."""
    if not is_file:
        return Claim(safe(target), [])
    path = Path(target).resolve()
    stem = safe(path.stem)
    units = ", ".join(f"{unit} {model}" for unit, model in sorted(models.items()))
    folder.mkdir(parents=True, exist_ok=True)
    with _alone(folder):
        owners = list(_owners(folder))
        own = next((owner for owner in owners if owner.path == str(path)), None)
        reports: list[str] = []
        if own is None:
            own = _left_behind(
                [owner for owner in owners if _has_images(folder, owner.name)], path, units, folder, reports
            )
        if own is None:
            taken = {owner.name for owner in owners if os.path.lexists(owner.path)} | set(MODELS)
            name = _free(folder, stem, taken)
            _take_old_names(folder, f"{stem}-{hashlib.sha256(os.fsencode(path)).hexdigest()[:8]}", name)
        else:
            name = own.name
        _write_owner(folder, Owner(name, str(path), _file(path), units))
    return Claim(name, reports)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """No other process looks for a name meanwhile. One that stands still is waited for as long as `PATIENCE`."""
    flags = os.O_RDWR | os.O_CREAT | NO_LINK
    descriptor = os.open(folder / "cells.lock", flags, 0o666)
    until = time.monotonic() + PATIENCE
    try:
        while True:
            try:
                lock(descriptor)
                break
            except BlockingIOError as error:
                if time.monotonic() >= until:
                    told = f"another process has {folder / 'cells.lock'} and does not let go of it"
                    raise BlockingIOError(error.errno, told) from None
            time.sleep(0.02)
        yield
    finally:
        os.close(descriptor)


def safe(name: str) -> str:
    """`name` as part of a file name; a name that had to be changed is told apart by digits made of it."""
    changed = re.sub(r"[^A-Za-z0-9_-]", "_", name)[:64]
    return changed if changed == name else f"{changed}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"


def _left_behind(owners: list[Owner], path: Path, units: str, folder: Path, reports: list[str]) -> Owner | None:
    """The images of a cell file that is gone, if it is this one that was moved; what is not certain is reported."""
    gone = [owner for owner in owners if not os.path.lexists(owner.path)]
    moved = [owner for owner in gone if owner.file == _file(path)]
    moved = moved or [owner for owner in gone if owner.units == units and Path(owner.path).stem == path.stem]
    if len(moved) == 1:
        reports.append(f"{path} was {moved[0].path}: its EEPROM images {folder / moved[0].name}.*{SUFFIX} are used")
        return moved[0]
    for owner in owners:
        images = f"{folder / owner.name}.*{SUFFIX}"
        if owner in gone and owner.units == units:
            what = f"if it was {owner.path}, its images are {images}: write its path into {folder / owner.name}.cell"
            reports.append(f"{path} begins with empty EEPROMs; {what}")
        elif owner not in gone and Path(owner.path).stem == path.stem:
            reports.append(
                f"{path} begins with empty EEPROMs: {images} are those of {owner.path}, which is there still"
            )
    return None


def _free(folder: Path, stem: str, taken: set[str]) -> str:
    """A name that no other cell has."""
    names = (stem if number == 1 else f"{stem}-{number}" for number in count(1))
    return next(name for name in names if name not in taken and not _has_images(folder, name))


def _has_images(folder: Path, name: str) -> bool:
    return bool(_images(folder, name))


def _images(folder: Path, name: str) -> list[Path]:
    """Everything that is kept under the name of a cell: its images, older ones, damaged ones."""
    begin = f"{name}."
    return [folder / file for file in os.listdir(folder) if file.startswith(begin) and SUFFIX in file[len(begin) - 1 :]]


def _take_old_names(folder: Path, before: str, name: str) -> None:
    """Images that were named by digits made of the path get the name that people can read."""
    for image in _images(folder, before):
        image.rename(image.with_name(image.name.replace(before, name, 1)))


def _file(path: Path) -> str:
    try:
        found = path.stat()
    except OSError:
        return ""
    return f"{found.st_dev}:{found.st_ino}"


def _owners(folder: Path) -> Iterator[Owner]:
    """Every `NAME.cell` that can be read."""
    for place in sorted(folder.glob("*.cell")):
        try:
            facts = tomllib.loads(_decoded(read_kept(place, _MOST_OWNER)))
            yield Owner(place.name.removesuffix(".cell"), str(facts["path"]), str(facts["file"]), str(facts["units"]))
        except (OSError, ValueError, KeyError, RecursionError):
            continue


def _decoded(data: bytes) -> str:
    """A path is any bytes: those that are no UTF-8 are kept as Python keeps them in names of files."""
    return data.decode("utf-8", "surrogateescape")


def _write_owner(folder: Path, owner: Owner) -> None:
    place = folder / f"{owner.name}.cell"
    facts = owner._asdict().items()
    text = _HEAD + "".join(f"{name} = {written(value)}\n" for name, value in facts if name != "name")
    with suppress(OSError):
        if _decoded(read_kept(place, _MOST_OWNER)) == text:
            return
    temporary = place.with_name(f"{place.name}.new")
    temporary.unlink(missing_ok=True)
    descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | NO_LINK, 0o666)
    with os.fdopen(descriptor, "w", encoding="utf-8", errors="surrogateescape") as file:
        file.write(text)
    temporary.replace(place)
