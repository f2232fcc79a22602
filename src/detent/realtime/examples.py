"""Where the examples are."""

from pathlib import Path


def home() -> Path:
    """The folder of the examples: beside an installed package, or in the project's own folder."""
    package = Path(__file__).parents[1]
    installed = package / "examples"
    return installed if installed.is_dir() else package.parents[1] / "examples"
