"""A new cell out of units and wires, and what can be opened."""

import asyncio
from pathlib import Path
from typing import Any

import pytest

from detent.cell.description import parse
from detent.workbench.beginning import EXAMPLE, Beginning
from detent.workbench.drafts import Drafts
from detent.workbench.folder import Folder
from detent.workbench.live import Live
from detent.workbench.newcell import NewCell, jacks

DRILLING = {
    "title": "Drilling",
    "units": [{"name": "bar", "model": "gs-c200"}, {"name": "drill", "model": "gs-c200"}],
    "wires": [{"source": "bar.UO2", "target": "drill.UI2"}, {"source": "drill.UO1", "target": "bar.UI2"}],
    "switches": [{"name": "start", "drives": "bar.UI1"}],
}


def test_a_new_cell_is_written_as_a_person_would_write_it() -> None:
    assert NewCell.model_validate(DRILLING).text() == (
        'title = "Drilling"\n\n[units.bar]\nmodel = "gs-c200"\n\n[units.drill]\nmodel = "gs-c200"\n\n'
        '[[wires]]\nfrom = "bar.UO2"\nto = "drill.UI2"\n\n[[wires]]\nfrom = "drill.UO1"\nto = "bar.UI2"\n\n'
        '[switches.start]\ndrives = "bar.UI1"\nlevel = 0\n'
    )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"units": []}, "at least one unit"),
        ({"units": [{"name": "bar", "model": "gs-c300"}], "wires": [], "switches": []}, "gs-c200"),
        ({"wires": [{"source": "bar.UO9", "target": "drill.UI2"}]}, "UO9"),
        ({"wires": [{"source": "bar.UO2", "target": "saw.UI2"}]}, "saw"),
        ({"units": [{"name": "bar", "model": "gs-c200"}] * 2}, "two units"),
    ],
)
def test_what_is_wrong_with_a_new_cell_is_said(change: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        NewCell.model_validate(DRILLING | change).text()


FITTED = {
    "units": [{"name": "bar", "model": "gs-c200", "straps": {"CHS": "low", "RXD": "high"}, "program": "bar.gsc"}],
    "motors": [{"unit": "bar", "motor": "17hs4401", "supply": 24, "lead": 0.04}],
}


def test_a_unit_has_straps_a_program_and_a_motor() -> None:
    text = NewCell.model_validate(FITTED).text(lambda file: "+10\n")
    assert text == (
        '[units.bar]\nmodel = "gs-c200"\nstraps = { CHS = "low", RXD = "high" }\nprogram = "bar.gsc"\n\n'
        '[motors.bar_motor]\nunit = "bar"\nmotor = "17hs4401"\nsupply = 24\nlead = 0.04\n'
    )


@pytest.mark.parametrize(
    ("unit", "words"),
    [
        ({"straps": {"CHX": "low"}}, "CHX"),
        ({"program": "none.gsc"}, "cannot be read|none.gsc"),
        ({"program": "bad.gsc"}, "bad.gsc"),
    ],
)
def test_what_is_wrong_with_what_a_unit_has_is_said(tmp_path: Path, unit: dict[str, Any], words: str) -> None:
    (tmp_path / "bad.gsc").write_text("no program\n")
    with pytest.raises(ValueError, match=words):
        NewCell.model_validate({"units": [{"name": "bar", "model": "gs-c200", **unit}]}).text(
            lambda file: (tmp_path / file).read_text()
        )


def told(pin: str, level: str, model: str) -> str:
    """The cell file with that strap, or what is said to be wrong with it."""
    try:
        return NewCell.model_validate({"units": [{"name": "unit", "model": model, "straps": {pin: level}}]}).text()
    except ValueError as error:
        return str(error)


def test_every_strap_of_every_model_is_tied_or_said_to_be_wrong() -> None:
    found = [
        (pin, told(pin, level, model))
        for model, sides in jacks().items()
        for pin in sides["straps"]
        for level in ("low", "high")
    ]
    assert all(pin in words for pin, words in found)
    assert sum(words.startswith("[units.unit]") for _, words in found) > 40


@pytest.mark.parametrize("name", ["Zwei Achsen", 'a"b', "a.b", "ä", "\n"])
def test_any_title_comes_back(name: str) -> None:
    text = NewCell.model_validate(DRILLING | {"title": name}).text()
    assert parse(text, "cell").title == name


def test_every_jack_of_every_model_can_be_wired() -> None:
    for model, sides in jacks().items():
        units = [{"name": "source", "model": "gs-c200"}, {"name": "unit", "model": model}]
        for pin in sides["in"]:
            wires = [{"source": "source.UO1", "target": f"unit.{pin}"}]
            assert NewCell.model_validate({"units": units, "wires": wires}).text()


class Bench:
    """What `Beginning` wants of a bench."""

    def __init__(self) -> None:
        self.opened: list[str] = []
        self.picture = type("Picture", (), {"target": "gs-c200"})()

    async def open_another(self, target: str) -> None:
        self.opened.append(target)


def test_places_are_models_examples_and_the_cells_of_the_folder(tmp_path: Path) -> None:
    async def scene() -> None:
        bench: Any = Bench()
        begin = Beginning(bench, Live(), Folder(tmp_path), Drafts(tmp_path, "old"))
        cell = NewCell.model_validate(DRILLING)
        (tmp_path / "kept.toml").write_text('format = "detent backup 1"\n')
        assert await begin.save_cell("drilling", cell) == "drilling.toml"
        with pytest.raises(FileExistsError):
            await begin.save_cell("drilling.toml", cell)
        await begin.save_cell("drilling.toml", cell, over=True)
        places: Any = await begin.places()
        assert places["cells"] == [("drilling.toml", "Drilling")]
        assert [f"{EXAMPLE}drilling/bar-after-bar.toml"] == [one for one, _ in places["examples"] if "bar-after" in one]
        for place in ("drilling.toml", places["examples"][0][0], "dcb-274"):
            await begin.open_place(place)
        assert bench.opened[-1] == "dcb-274"
        for outside in ("../x.toml", "example:../../x.toml", "/etc/x.toml"):
            with pytest.raises(ValueError, match=r"outside|no example|relative"):
                await begin.open_place(outside)

    asyncio.run(scene())
