"""Backups of units: for which model one is, how its lines are explained, where what a restore replaces is kept."""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from detent.hosts.backups import Backup, BackupError, Explain
from detent.realtime.connect import HOSTS
from detent.workbench.words import words


def backup_of(model: str, port: str, saved: Mapping[str, Any]) -> Backup:
    """The backup of what a unit has told just now."""
    when = datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    return Backup(model, saved, f"What the {model} at {port} held on {when}.")


def check_fits(of: str, model: str) -> None:
    """Raise BackupError if a backup `of` a model is not for `model`. Boards of one firmware take each other's."""
    if of != model and (HOSTS.get(of) is not HOSTS[model] or HOSTS[model].takes_model):
        raise BackupError(f"it is the backup of a {of}, and this is a {model}")


def file_before(model: str, state: Path) -> Path:
    """A new file below `state` for what a unit held before a restore."""
    when = datetime.now(UTC).strftime("%Y%m%d-%H%M%S-%f")
    return state / "before-restore" / f"{model}-{when}.toml"


def explained(model: str) -> Explain:
    """What the model's command table says of a line of a program, where it leaves no choice."""
    known = words(model)  # the longest first

    def explain(line: str) -> str:
        rows = next((word.rows for word in known if line.startswith(word.spelling)), ())
        return rows[0].what if len(rows) == 1 else ""

    return explain
