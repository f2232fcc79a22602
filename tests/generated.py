"""How many cases a test generates: all by `make test-all`, half by `make test` (the profiles in `conftest.py`)."""

from hypothesis import settings


def examples(many: int) -> int:
    """The `max_examples` of a test that tries `many` where time does not matter."""
    return max(many * settings.default.max_examples // 100, 10)
