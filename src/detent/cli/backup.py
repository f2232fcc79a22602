"""The verbs `backup` and `restore`: everything that a unit keeps, to a readable file and back."""

import json as json_text
import sys
from collections.abc import Mapping
from errno import EILSEQ
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

from detent.cli.overwrite import Overwrite
from detent.cli.unit import NO_UNIT_OPTIONS, ModelName, PortName, UnitOptions

if TYPE_CHECKING:
    from detent.hosts.backups import Backup
    from detent.hosts.exchange import Blocking


class Keeper(Protocol):
    """A driver of a unit that keeps something."""

    def saved(self) -> dict[str, Any]:
        """Everything that can be read of what it keeps."""

    def restore(self, saved: Mapping[str, Any], /) -> list[str]:
        """Write it back; what was written, in sentences."""


def backup(
    model: ModelName,
    port: PortName,
    file: Path,
    *,
    overwrite: Overwrite = False,
    json: bool = False,
    unit: UnitOptions = NO_UNIT_OPTIONS,
) -> None:
    """Write everything that a unit keeps to a readable file.

    That is its programs, its parameters, its memory, as far as it tells. Nothing is changed in the unit. The file
    is TOML; it is written whole or not at all. A file that is there is kept, and the backup gets a number: unit-2.toml.

    For example: `detent backup gs-c200 /dev/ttyUSB0 machine.toml`

    Parameters
    ----------
    file
        The file to write, FILE.toml.
    overwrite
        Write over a file that is there.
    json
        Print what was saved as JSON, too.
    """
    from detent.cli.unit import progress
    from detent.cli.unit import unit as connected

    _keeps(model)
    with progress(f"reading the {model}") as watch, connected(model, port, unit, watch) as found:
        saved = _read(found, model, port)._replace(options=unit.written())
    wanted, file = file, file if overwrite else _free(file)
    _write(file, saved)
    if wanted != file:
        print(f"detent: {wanted} is there and is kept; --overwrite writes over it", file=sys.stderr)
    if json:
        print(json_text.dumps({"model": model, "port": port, "file": str(file), "saved": saved.saved}))
    else:
        print(f"Wrote {file}: {_contents(saved)}")


def restore(
    model: ModelName,
    port: PortName,
    file: Path,
    *,
    yes: bool = False,
    json: bool = False,
    unit: UnitOptions = NO_UNIT_OPTIONS,
) -> None:
    """Write a backup back to a unit.

    What differs is shown first, and nothing is written before you agree. What the unit holds now is kept in a file,
    which is named; if it fails half way, it says what is where.

    For example: `detent restore gs-c200 /dev/ttyUSB0 machine.toml`

    Parameters
    ----------
    file
        A file that `detent backup` wrote.
    yes
        Write without asking.
    json
        Print the result as one line of JSON; needs --yes.
    """
    from detent.cli.endings import asked_wrongly, failed
    from detent.cli.unit import progress
    from detent.cli.unit import unit as connected
    from detent.hosts.backups import Backup, BackupError
    from detent.hosts.errors import DriverError
    from detent.realtime.images import default_folder
    from detent.workbench.units.backups import check_fits, file_before

    _keeps(model)
    try:
        wanted = Backup.parse(_text(file))
        check_fits(wanted.model, model)
        if json and not yes:
            raise BackupError("with --json nobody is asked: say --yes")
    except BackupError as error:
        asked_wrongly(BackupError(f"{file}: {error}"))
    with progress(f"reading the {model}") as watch, connected(model, port, unit, watch) as found:
        there = _read(found, model, port)
    differences = wanted.differences(there.saved)
    if not differences:
        _tell(json, file, [], ["nothing differs: the unit holds what the file says"], None)
        return
    if not json:
        print("\n".join(differences))
    if not yes and not sys.stdin.isatty():
        asked_wrongly("nobody can be asked here, and nothing was written: say --yes to write it")
    if not yes and input(f"Write {file} to the unit? [y/N] ").strip().lower() not in ("y", "yes"):
        failed("nothing was written")
    before = file_before(model, default_folder())
    _write(before, there._replace(options=unit.written()))
    with progress(f"writing to the {model}") as watch, connected(model, port, unit, watch) as found:
        try:
            told = cast("Keeper", found).restore(wanted.saved)
        except ValueError as error:  # of what the file says; nothing was written
            asked_wrongly(BackupError(f"{file}: {error}"))
        except DriverError:
            print(f"detent: what the unit held before is in {before}", file=sys.stderr)
            raise
        except KeyboardInterrupt:
            again, how = f"detent restore {model} {port}", unit.written()
            print(f"detent: interrupted: the unit may hold part of {file}; {again} {file}{how} writes the rest, "
                  f"{again} {before}{how} what it held before", file=sys.stderr)  # fmt: skip
            raise
    _tell(json, file, differences, told, before)


def _tell(json: bool, file: Path, differences: list[str], told: list[str], before: Path | None) -> None:
    if json:
        facts = {"file": str(file), "differences": differences, "told": told, "before": str(before) if before else None}
        print(json_text.dumps(facts))
        return
    print("\n".join(told))
    if before is not None:
        print(f"What it held before is in {before}")


def _keeps(model: str) -> None:
    """End the program if a model keeps nothing, or is none."""
    from detent.cli.endings import asked_wrongly
    from detent.realtime.connect import host

    try:
        if not hasattr(host(model).shell("Blocking"), "saved"):
            raise ValueError(f"a {model} keeps nothing that it tells: what it knows is burnt into its EPROM")
    except ValueError as error:
        asked_wrongly(error)


def _read(unit: "Blocking", model: str, port: str) -> "Backup":
    from detent.workbench.units.backups import backup_of

    return backup_of(model, port, cast("Keeper", unit).saved())


def _free(file: Path) -> Path:
    """`file`, or if something is there the first of file-2, file-3 and so on where nothing is."""
    number, place = 1, file
    while not place.is_dir() and (place.exists() or place.is_symlink()):
        number += 1
        place = file.with_name(f"{file.stem}-{number}{file.suffix}")
    return place


def _write(file: Path, saved: "Backup") -> None:
    from detent.cli.endings import failed
    from detent.outputs.files import write_whole
    from detent.workbench.units.backups import explained

    text = saved.text(explained(saved.model))
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, text.encode())
    except OSError as error:
        failed(f"{file}: not written: {error.strerror or error}")


def _text(file: Path) -> str:
    from detent.hosts.backups import BackupError
    from detent.realtime.texts import read_text

    try:
        return read_text(file)
    except OSError as error:
        if error.errno == EILSEQ:
            raise BackupError(f"it is no text file: {error.strerror}") from None
        raise BackupError(f"cannot read it: {error.strerror or error}") from None


def _contents(saved: "Backup") -> str:
    """What is in a backup, in a few words."""
    parts = []
    for key, value in saved.saved.items():
        if isinstance(value, list):
            parts.append(f"{key} of {len(value)} lines")
        elif isinstance(value, dict):
            parts.append(f"{key} ({len(value)})")
        else:
            parts.append(f"{key} {value}")
    return ", ".join(parts)
