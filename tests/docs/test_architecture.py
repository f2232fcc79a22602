"""What the architecture and the explanations name is there: rooms, files, names of the code."""

import re
import tomllib
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src" / "detent"
PAGES = [ROOT / "ARCHITECTURE.md", *sorted((ROOT / "docs" / "explanation").glob("*.md"))]
ROOMS = ("workbench", "workbench/assets", "realtime", "realtime/boards", "cell", "outputs", "tuner")
FOLDERS = [ROOT, PACKAGE, *(PACKAGE / name for name in ROOMS)]
"""Where a path may begin: a page that has named a room goes on from there."""
HOMES = ["detent", "detent.cell", "detent.realtime", "detent.workbench", "detent.controllers.gsc200"]


def test_the_table_of_rooms_is_the_house_that_is_checked() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = next(contract["layers"] for contract in contracts if contract["type"] == "layers")
    text = (ROOT / "ARCHITECTURE.md").read_text()
    table = text[text.index("| room |") : text.index("Each controller has the same rooms")]
    rows = [re.findall(r"`(\w+)/?`", line.split("|")[1]) for line in table.splitlines()[2:] if line]
    rooms = [room for row in rows for room in row]
    place = {room: number for number, layer in enumerate(layers) for room in re.split(r"[ |]+", layer)}
    assert sorted(rooms) == sorted(place)
    assert [place[room] for room in rooms] == sorted(place.values()), "in the order in which imports run"
    for room in rooms:
        assert (PACKAGE / room).is_dir() is (f"`{room}/`" in table), room


def quoted(page: Path) -> Iterator[str]:
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.S)
    yield from re.findall(r"`([^`\n]+)`", text)


def there(path: str) -> bool:
    """Whether a path is one, from the root, the package or a room that was named: with or without its .py."""
    return any((folder / f"{path}{end}").exists() for folder in FOLDERS for end in ("", ".py"))


def resolves(name: str) -> bool:
    """Whether a dotted name is a module, or something in one."""
    parts = name.split(".")
    for home in HOMES:
        for length in range(len(parts), 0, -1):
            module = ".".join([home, *parts[:length]])
            try:
                found = find_spec(module) is not None
            except ModuleNotFoundError:
                continue
            if found:
                here: object = import_module(module)
                for part in parts[length:]:
                    if not hasattr(here, part) and part not in getattr(here, "__annotations__", {}):
                        break
                    here = getattr(here, part, None)
                else:
                    return True
    return False


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_path_of_a_page_is_there(page: Path) -> None:
    paths = [one for one in quoted(page) if re.fullmatch(r"[\w.-]+(/[\w.-]*)+|\w+\.(py|js|md|toml)", one)]
    assert [path for path in paths if not there(path) and not resolves(path.replace("/", "."))] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_module_that_a_page_names_has_what_it_says(page: Path) -> None:
    rooms = {path.stem for path in PACKAGE.iterdir()} | {
        path.stem for path in (PACKAGE / "controllers" / "gsc200").iterdir()
    }
    names = [one for one in quoted(page) if re.fullmatch(r"[a-z]\w*(\.\w+)+", one) and one.split(".")[0] in rooms]
    assert [name for name in names if not resolves(name) and not name.endswith((".py", ".js"))] == []
