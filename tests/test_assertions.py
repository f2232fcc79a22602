"""Every test can fail by what it looks at: it asserts, expects an error, or names something of the tests that does."""

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent
EXPECTING = {"raises", "warns", "fail"}

Function = ast.FunctionDef | ast.AsyncFunctionDef


def named(node: ast.AST) -> Iterator[str]:
    """The names in it, whoever they belong to: what is named may be called."""
    for found in ast.walk(node):
        if isinstance(found, ast.Name):
            yield found.id
        elif isinstance(found, ast.Attribute):
            yield found.attr


def looks(node: ast.AST) -> bool:
    """Whether it asserts itself, raises, or expects an error."""
    own = any(isinstance(found, ast.Assert | ast.Raise) for found in ast.walk(node))
    return own or not EXPECTING.isdisjoint(named(node))


def blind(sources: dict[str, str]) -> list[str]:
    """The tests that look at nothing. What is named looks if everything of that name among the sources does."""
    by_name: dict[str, list[Function | ast.ClassDef]] = defaultdict(list)
    tests: list[tuple[str, Function]] = []
    for name, source in sources.items():
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, Function | ast.ClassDef):
                by_name[node.name].append(node)
            if isinstance(node, Function) and node.name.startswith("test_"):
                tests.append((name, node))
    looking = {name for name, nodes in by_name.items() if all(map(looks, nodes))}
    left = {name: [set(named(node)) for node in nodes] for name, nodes in by_name.items() if name not in looking}
    while found := {name for name, calls in left.items() if all(looking & each for each in calls)}:
        looking |= found
        left = {name: calls for name, calls in left.items() if name not in found}
    return [
        f"{name}:{test.lineno} {test.name}"
        for name, test in tests
        if not looks(test) and not looking & set(named(test))
    ]


def test_every_test_looks_at_something() -> None:
    sources = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in sorted(ROOT.rglob("*.py"))}
    assert blind(sources) == []


@pytest.mark.parametrize(
    ("body", "sees"),
    [
        ("assert f() == 1", True),
        ("with pytest.raises(ValueError): f()", True),
        ("helper()", True),
        ("bench.through()", True),
        ("f()", False),
        ("mixed()", False),
        ("list(map(helper, (1, 2)))", True),
        ("list(map(f, (1, 2)))", False),
    ],
)
def test_a_test_that_looks_at_nothing_is_found(body: str, sees: bool) -> None:
    helpers = (
        "def helper():\n    assert g()\nclass Bench:\n    def through(self):\n        helper()\n"
        "def f():\n    return 1\ndef mixed():\n    assert g()\nclass Other:\n    def mixed(self):\n        pass\n"
    )
    found = blind({"helpers.py": helpers, "test_it.py": f"def test_it():\n    {body}\n"})
    assert (found == []) is sees
