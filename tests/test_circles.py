"""No two files import each other, by however many others; imports in functions and for types count, too."""

import ast
from collections.abc import Iterable, Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1] / "src"


def modules(root: Path) -> dict[str, Path]:
    """The file of each module below `root`, by its dotted name."""
    found = {}
    for path in sorted(root.rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported(name: str, path: Path, known: Iterable[str]) -> Iterator[str]:
    """The modules that a file takes something from, wherever in it that stands."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
                base = ".".join([*package[: len(package) - node.level + 1], *filter(None, [base])])
            for alias in node.names:
                inner = f"{base}.{alias.name}"
                if inner in known or base in known:
                    yield inner if inner in known else base


def graph(root: Path) -> Mapping[str, set[str]]:
    """Of each module those that it imports."""
    known = modules(root)
    return {name: set(imported(name, path, known)) - {name} for name, path in known.items()}


def circle(arrows: Mapping[str, set[str]]) -> list[str]:
    """The modules of one circle, the first of them again at its end; [] if there is none."""
    try:
        TopologicalSorter(arrows).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_no_files_import_each_other_in_a_circle() -> None:
    found = circle(graph(ROOT))
    assert not found, " <- ".join(found)


@pytest.mark.parametrize(
    "back",
    [
        "from house.upper import Upper",
        "from house import upper",
        "import house.upper",
        "from . import upper",
        "from .upper import Upper",
        "def later():\n    from house.upper import Upper",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from house.upper import Upper",
    ],
)
def test_a_circle_is_found_however_it_is_written(tmp_path: Path, back: str) -> None:
    house = tmp_path / "house"
    house.mkdir()
    (house / "__init__.py").write_text("")
    (house / "upper.py").write_text("from house.middle import Middle\n")
    (house / "middle.py").write_text("import house.lower\n")
    (house / "lower.py").write_text("import os\n")
    assert circle(graph(tmp_path)) == []
    (house / "lower.py").write_text(f"{back}\n")
    assert set(circle(graph(tmp_path))) == {"house.upper", "house.middle", "house.lower"}
