"""Settings put into a text: a program, a backup, a cell file; or a program of their own.

What sets the same things already is replaced where it stands; nothing else in the text is touched.
"""

import re
from typing import NamedTuple

from detent.tuner.spaces import Profile
from detent.tuner.task import Task, TunerError


class Changed(NamedTuple):
    """The text with the settings in it, and what was put in place of what."""

    text: str
    replaced: tuple[str, ...]


_KEYS = {"K": ("stop_rate",), "R": ("run_rate",), "P": ("slope", "ramp"), "!": ("step_size",)}
"""The settings of a board as backups and the options of cells name them."""


def put_into(text: str, profile: Profile, axis: str = "") -> Changed:
    """The settings in place of those that are there. TunerError where there are none of some kind.

    A setting is a line of a program (behind a label, before a comment), or such a line in quotes: in a backup, in the
    script of a cell. Those of a board may be keys of a backup (of `axis` alone, if one is named) or options of a unit,
    and the table of a SUPERSIGMA is one.
    """
    before, part, behind = _part_of(text, axis)
    replaced: list[str] = []
    missing: list[str] = []
    for line in profile.settings:
        if not re.search(r"\d", line):
            continue  # the choice of a motor
        shape = re.sub(r"\d+", r"\\d+", re.escape(line).replace(r"\ ", r"[ \t]+"))
        pattern = re.compile(rf"""(?m)((?:^|["'])[ \t]*(?:\w+:[ \t]*)?)({shape})(?=[ \t]*(?:;|["']|$))""")
        part, count = _replaced(pattern, line, part, replaced)
        for key in _KEYS.get(line[-1], ()):
            part, more = _replaced(_key(key), line[:-1], part, replaced)
            if key == "step_size" and not more:
                before, more = _replaced(_key(key), line[:-1], before, replaced)
            count += more
        if not count:
            missing.append(line)
    if "table" in profile.options:
        for name, value in profile.options.items():
            part, count = _replaced(_key(name), value, part, replaced)
            if not count:
                missing.append(f"the option {name}")
    if missing:
        raise TunerError(f"nothing there sets what {', '.join(missing)} sets: put such a line in, or write a file anew")
    return Changed(before + part + behind, tuple(replaced))


def _part_of(text: str, axis: str) -> tuple[str, str, str]:
    """What is before the table of this motor in a backup, the table, and what is behind it; else all of the text."""
    found = re.search(rf"(?m)^\[saved\.{axis}\]$", text) if axis else None
    if found is None:
        return "", text, ""
    ends = re.search(r"(?m)^\[", text[found.end() :])
    end = found.end() + ends.start() if ends else len(text)
    return text[: found.start()], text[found.start() : end], text[end:]


def _key(name: str) -> re.Pattern[str]:
    return re.compile(rf"""(\b{name}[ \t]*=[ \t]*["']?)([\w:]+)""")


def _replaced(pattern: re.Pattern[str], new: str, text: str, replaced: list[str]) -> tuple[str, int]:
    for _, old in pattern.findall(text):
        shown = f"{old} -> {new}" if old != new else f"{old} as before"
        replaced.append(shown if len(shown) < 60 else f"{old[:12]}... -> {new[:12]}...")
    return pattern.subn(lambda match: match.group(1) + new, text)


def program(task: Task, profile: Profile) -> str:
    """A program source of the settings and the moves. TunerError for a model without programs."""
    lines = list(profile.settings)
    if "table" in profile.options:
        raise TunerError(f"a {task.model} runs no programs, its table is an option: name a cell with --from FILE")
    return "\n".join([*lines, *(profile.go(move.steps) for move in task.moves)]) + "\n"
