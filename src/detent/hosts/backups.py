"""A backup as text: everything that a unit keeps, in TOML that people read and `restore` takes back."""

import re
from collections.abc import Callable, Mapping
from difflib import unified_diff
from typing import Any, Final, NamedTuple

from detent import toml

FORMAT: Final = "detent backup 1"
KEY: Final = re.compile(r"[A-Za-z0-9_-]+")
PROGRAMS: Final = ("program", "ram")  # the keys under which lines are those of programs
MEMORY: Final = "memory"  # the key under which lines are bytes from address 0 on

Explain = Callable[[str], str]
"""Gives a line of help for a line of a program."""


class BackupError(ValueError):
    """A text that is no backup of this unit. It says what is wrong and what to do."""


class Backup(NamedTuple):
    """What `saved` returned, of a unit of `model`; `note` says when and where, `options` how to reach it again."""

    model: str
    saved: Mapping[str, Any]
    note: str = ""
    options: str = ""

    def text(self, explain: Explain = lambda line: "") -> str:
        """The file. Lines of programs have what `explain` says of them behind."""
        lines = [f"# {self.note}"] if self.note else []
        lines.append(f"# Back into the unit: detent restore {self.model} PORT FILE{self.options}")
        if not isinstance(self.saved.get(MEMORY, ""), str):
            lines.append("# What is written back is memory, bytes with their addresses; the rest is there to be read.")
        lines += [
            "",
            f"format = {_value(FORMAT)}",
            f"model = {_value(self.model)}",
            *_table(("saved",), self.saved, explain),
        ]
        return "\n".join(lines) + "\n"

    @classmethod
    def parse(cls, text: str) -> "Backup":
        """Read a file. Raises BackupError."""
        try:
            found = toml.loads(text)
        except toml.NoToml as error:
            raise BackupError(str(error)) from None
        if found.get("format") != FORMAT:
            raise BackupError(f"it is no backup: those begin with format = {_value(FORMAT)}; detent backup writes them")
        model, saved = found.get("model"), found.get("saved")
        if not isinstance(model, str) or not isinstance(saved, dict):
            raise BackupError("model and [saved] must be there, as detent backup writes them")
        return cls(model, saved)

    def differences(self, there: Mapping[str, Any]) -> list[str]:
        """What restoring it changes in a unit that holds `there`: the lines of a diff, from the unit to the file."""
        texts = [_table(("saved",), saved, lambda line: "") for saved in (there, self.saved)]
        return list(unified_diff(texts[0], texts[1], "the unit", "the file", lineterm="", n=1))


def _table(path: tuple[str, ...], values: Mapping[str, Any], explain: Explain) -> list[str]:
    """A table with what belongs to it: its own values first, then the tables in it."""
    lines = ["", f"[{'.'.join(map(_key, path))}]"]
    for key, value in values.items():
        if isinstance(value, Mapping):
            continue
        if isinstance(value, list):
            lines.append(f"{_key(key)} = [")
            address = 0
            for one in value:
                lines.append(f"    {_value(one)},{_comment(explain(one) if key in PROGRAMS else '')}")
                if key == MEMORY:
                    lines[-1] += _comment(str(address))
                    address += len(str(one).split())
            lines.append("]")
        else:
            lines.append(f"{_key(key)} = {_value(value)}")
    for key, value in values.items():
        if isinstance(value, Mapping):
            lines += _table((*path, key), value, explain)
    return lines


def _key(key: str) -> str:
    return key if KEY.fullmatch(key) else _value(key)


def _comment(text: str) -> str:
    return f"  # {text}" if text else ""


def _value(value: object) -> str:
    """A value in TOML. ValueError for one that it has not."""
    match value:
        case bool():
            return str(value).lower()
        case int() | float():
            return repr(value)
        case str():
            return '"' + re.sub(r'[\x00-\x1f\x7f"\\]', lambda found: f"\\u{ord(found[0]):04X}", value) + '"'
    raise ValueError(f"{value!r} has no place in a backup")
