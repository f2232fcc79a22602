"""The pages are true: generated parts are up to date, links lead somewhere, proofs exist, keys are the code's."""

import importlib.util
import re
from dataclasses import is_dataclass
from pathlib import Path
from types import ModuleType
from typing import get_args

import pytest
from pydantic import BaseModel

from detent.cell import description, form
from detent.cell.build import build
from detent.cell.description import Problem, parse

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(page for page in DOCS.rglob("*.md") if "_build" not in page.parts)
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]
GSC200 = (DOCS / "controllers" / "gsc200.md").read_text()


def generator() -> ModuleType:
    found = importlib.util.spec_from_file_location("generate", DOCS / "generate.py")
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def test_make_docs_would_change_nothing() -> None:
    generate = generator()
    assert generate.pages() == PAGES
    old = [name for name, page in zip(NAMES, PAGES, strict=True) if generate.page(page.read_text()) != page.read_text()]
    assert not old, "run `make docs`"
    assert [name for name, make in generate.FILES.items() if (DOCS / name).read_text() != make()] == []


def test_every_generated_part_has_its_place() -> None:
    generate = generator()
    assert sorted(name for page in PAGES for name in generate.names(page.read_text())) == sorted(generate.PARTS)


def anchors(page: Path) -> set[str]:
    """The headings of a page as links name them."""
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_links_lead_somewhere(page: Path) -> None:
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" in target:
            continue
        place, _, anchor = target.partition("#")
        other = (page.parent / place).resolve() if place else page
        assert other.exists(), target
        assert not anchor or anchor in anchors(other), target


def test_every_page_is_found_from_the_index() -> None:
    index = (DOCS / "index.md").read_text()
    for page in PAGES:
        if page.name != "index.md":
            assert f"({page.relative_to(DOCS)})" in index, page.name


def rulings() -> list[list[str]]:
    """The rows of the tables behind `<!-- rulings -->`."""
    found = []
    for part in GSC200.split("<!-- rulings -->")[1:]:
        lines = [line for line in part.split("\n### ")[0].splitlines() if line.startswith("|")]
        found += [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]
    return found


def scenes() -> dict[str, list[str]]:
    """The titles of the scenes of every dialogue file."""
    folder = ROOT / "tests" / "dialogues" / "gsc200"
    return {path.name: re.findall(r"^scene (.+)$", path.read_text(), re.MULTILINE) for path in folder.glob("*.txt")}


def test_every_ruling_has_a_proof_that_exists() -> None:
    assert len(rulings()) > 60
    functions = {
        name for path in (ROOT / "tests").rglob("test_*.py") for name in re.findall(r"def (test_\w+)", path.read_text())
    }
    titles = scenes()
    missing = []
    for subject, *_, proof in rulings():
        named = re.findall(r"`(test_\w+)`", proof)
        missing += [f"{subject}: {name}" for name in named if name not in functions]
        told = re.findall(r"`(\w+\.txt)`: (.+?)(?=, `|$)", proof)
        missing += [
            f"{subject}: {file}: {title}"
            for file, title in told
            if not any(scene.startswith(title) for scene in titles.get(file, []))
        ]
        assert named or told or "code" in proof, subject
    assert not missing


def reached(table: type[object], found: list[type[object]]) -> list[type[object]]:
    """A table of a cell file, and every table that one of its keys takes."""
    if table not in found:
        found.append(table)
        for hint in form.hints(table).values():
            for part in parts_of(hint):
                reached(part, found)
    return found


def parts_of(hint: object) -> list[type[object]]:
    if isinstance(hint, type) and (is_dataclass(hint) or issubclass(hint, BaseModel)):
        return [hint]
    return [part for inner in get_args(hint) for part in parts_of(inner)]


def test_the_reference_of_cell_files_has_every_table() -> None:
    assert set(generator().cell_keys.TABLES.values()) == set(reached(description.Description, []))


@pytest.mark.parametrize("name", generator().cell_keys.TABLES)
def test_every_key_of_a_cell_file_has_a_meaning(name: str) -> None:
    keys = generator().cell_keys
    for key, _, _, meaning in keys.rows(keys.TABLES[name]):
        assert len(meaning) > len(key), key


def refusal(text: str) -> str:
    with pytest.raises(Problem) as caught:
        build(parse(text, "cell.toml"), lambda file: "")
    return str(caught.value)


def test_pin_10_must_be_grounded() -> None:
    """Pin description: pin 10 "must be connected to pin 8"."""
    text = "[units.a]\nmodel = 'gs-c200'\nstraps = { TEST = 'high' }\n"
    assert "pin 10 (TEST) of a must be tied to ground" in refusal(text)


@pytest.mark.parametrize("level", [0, 1])
def test_a_line_has_one_pull_down(level: int) -> None:
    """Pin description, pin 13: open on all modules of a multipoint line except the terminator."""
    units = "".join(
        f"[units.{name}]\nmodel = 'gs-c200'\nstraps = {{ SEL2 = {sel}, SEL1 = 0, SEL0 = 0, TXPD = {level} }}\n"
        for name, sel in (("a", 0), ("b", 1))
    )
    assert "TXPD must be tied to TXD on one unit of a line" in refusal(f"{units}[lines.bus]\nunits = ['a', 'b']\n")
