"""How much of the past is kept in so much memory."""

from typing import Final

from detent.workbench.mirror import SLACK

BASE: Final = 210  # MB of both processes before anything has happened
BATCH: Final = 520  # bytes that a batch of the recording takes at most: of a host that polls, who says the most
LEAST_KEPT: Final = 20_000  # batches, however little memory there may be


def keep(memory: int) -> int:
    """How many batches of the past can be gone back over in so many MB of engine and pages together."""
    return max(int((memory - BASE) * 1e6 / (BATCH * (1 + 1 / SLACK))), LEAST_KEPT)
