"""How many cases a test generates: all by `make test-all`, a sixth by `make test` (the profiles in `conftest.py`)."""

from hypothesis import settings

ALL = 100  # the `max_examples` of the profile of `make test-all`


def examples(many: int) -> int:
    """The `max_examples` of a test that tries `many` where time does not matter."""
    return max(many * settings.default.max_examples // ALL, 10)


def seeds(many: int) -> range:
    """The numbers from which a test makes its cases, `many` where time does not matter; two at least."""
    return range(max(many * settings.default.max_examples // ALL, 2))
