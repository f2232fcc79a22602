"""How a verb ends that cannot do what it was asked to. Imports nothing, so that quick verbs stay quick."""

import sys
from typing import NoReturn

from detent.cli.codes import ASKED_WRONGLY, FAILED
from detent.one_line import MOST, one_line


def tell(text: object) -> None:
    """Say something on stderr as every verb does; what would steer a terminal is written out.

    A line that quotes very much loses its middle.
    """
    shown = "".join(sign if sign.isprintable() or sign in "\n\t" else repr(sign)[1:-1] for sign in str(text))
    lines = (line if len(line) <= MOST else one_line(line) for line in shown.split("\n"))
    print("detent: " + "\n".join(lines), file=sys.stderr, flush=True)


def of_system(error: OSError) -> str:
    """What the system has said, with the file that it is about, if it is about one."""
    what = error.strerror or str(error) or type(error).__name__
    return f"{error.filename}: {what}" if error.filename else what


def asked_wrongly(error: Exception | str) -> NoReturn:
    """Say what is wrong in one line on stderr and exit with 2."""
    tell(error)
    raise SystemExit(ASKED_WRONGLY)


def failed(error: Exception | str) -> NoReturn:
    """Say what failed in one line on stderr and exit with 1."""
    tell(error)
    raise SystemExit(FAILED)
