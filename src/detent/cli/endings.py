"""How a verb ends that cannot do what it was asked to. Imports nothing, so that quick verbs stay quick."""

import sys
from typing import NoReturn

from detent.cli import ASKED_WRONGLY, FAILED


def asked_wrongly(error: Exception | str) -> NoReturn:
    """Say what is wrong in one line on stderr and exit with 2."""
    print(f"detent: {error}", file=sys.stderr)
    raise SystemExit(ASKED_WRONGLY)


def failed(error: Exception | str) -> NoReturn:
    """Say what failed in one line on stderr and exit with 1."""
    print(f"detent: {error}", file=sys.stderr)
    raise SystemExit(FAILED)
