"""How long the tests of the workbench wait for what comes at once, when something is broken: the one place for it."""

import os
from typing import Final

PATIENCE: Final = float(os.environ.get("DETENT_PATIENCE", "180"))
"""Seconds. A loaded machine takes part of it; a test that passes never waits for it."""
