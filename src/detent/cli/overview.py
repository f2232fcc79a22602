"""What `detent --help` prints, character for character as cyclopts would, without the time that loading it takes."""

import os
import shutil
import sys
from collections.abc import Sequence
from textwrap import wrap

_BOLD, _CYAN, _PLAIN = "\033[1m", "\033[36m", "\033[0m"
_OTHERWISE = ("FORCE_COLOR", "NO_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE", "JUPYTER_COLUMNS")
_NARROWEST = 72  # columns; below that cyclopts squeezes what it prints in ways of its own


def is_asked_for(tokens: Sequence[str]) -> bool:
    """Whether it is asked for, at a terminal for which it is known how cyclopts writes."""
    if list(tokens) not in (["--help"], ["-h"], []):
        return False
    if any(name in os.environ for name in _OTHERWISE) or os.environ.get("TERM", "") in ("dumb", "unknown"):
        return False
    return (sys.stdout.encoding or "").lower().startswith("utf") and _columns() >= _NARROWEST


def show(title: str, verbs: Sequence[tuple[str, str]], completion: str) -> None:
    """Print it: what the command is, each verb with its line of help, and the line of the completion of shells."""
    print(text(title, verbs, completion, _columns(), colour=sys.stdout.isatty()))


def text(title: str, verbs: Sequence[tuple[str, str]], completion: str, columns: int, *, colour: bool) -> str:
    """The whole, for so many columns."""
    rows = [
        *verbs,
        ("--help (-h)", "Display this message and exit."),
        ("--install-completion", completion),
        ("--version", "Display application version."),
    ]
    left = max(len(name) for name, _ in rows)
    right = columns - left - 6  # a frame and a blank at both sides, two blanks between
    bold, cyan, plain = (_BOLD, _CYAN, _PLAIN) if colour else ("", "", "")
    lines = [f"{bold}Usage: {plain}{bold}detent COMMAND{plain}", "", title, ""]
    lines.append(f"╭─ Commands {'─' * (columns - 13)}╮")
    for name, help_ in rows:
        for number, part in enumerate(wrap(help_, right, break_on_hyphens=False)):
            if number:
                lines.append(f"│ {cyan}{'':{left + 2}}{plain}{part:{right}} │")
            else:
                lines.append(f"│ {cyan}{name:{left}}{plain}{cyan}  {plain}{part:{right}} │")
    lines.append(f"╰{'─' * (columns - 2)}╯")
    return "\n".join(lines)


def _columns() -> int:
    return shutil.get_terminal_size().columns
