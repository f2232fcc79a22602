"""The ways to make a movement that is too short for its table; `short_movements` makes it."""

from enum import Enum


class Way(Enum):
    """How the ramps of a short movement are chosen."""

    HYPERBOLA = "hyperbola"
    EXACT = "exact"
    FREE = "free"
