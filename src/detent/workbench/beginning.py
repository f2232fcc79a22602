"""What the page Begin asks of the server: what can be opened, opening it, making a new cell, looking commands up."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from detent.cell.build import build
from detent.cell.description import parse, single
from detent.controllers import catalogue
from detent.motors.named import MOTORS
from detent.realtime.examples import home
from detent.realtime.images import cell_name
from detent.realtime.texts import read_text
from detent.workbench.drafts import Drafts
from detent.workbench.folder import Folder
from detent.workbench.live import Live
from detent.workbench.newcell import NewCell, jacks

if TYPE_CHECKING:
    from detent.workbench.client import Bench

Name = Annotated[str, Field(max_length=1000)]
EXAMPLE = "example:"  # before the name of one, where a target is asked for


class Beginning:
    """Offers ``places open_place jacks fittings new_cell save_cell command_reference``."""

    def __init__(self, bench: "Bench", live: Live, folder: Folder, drafts: Drafts) -> None:
        """Cells are opened and saved in `folder`; `drafts` become those of the cell that is opened."""
        self._bench, self._folder, self._drafts = bench, folder, drafts
        for call in (
            self.places,
            self.open_place,
            self.jacks,
            self.fittings,
            self.new_cell,
            self.save_cell,
            self.command_reference,
        ):
            live.offer(call.__name__, call)

    async def places(self) -> dict[str, object]:
        """What can be opened: models, examples with their titles, cells in the folder; which is open."""
        return {
            "open": self._bench.picture.target,
            "models": [[name, model.title] for name, model in catalogue.MODELS.items()],
            "examples": [[EXAMPLE + name, title] for name, title in _cells(home())],
            "folder": str(self._folder.root),
            "cells": [list(cell) for cell in _cells(self._folder.root, self._folder.names((".toml",)))],
        }

    async def open_place(self, place: Name) -> str:
        """Show another cell in place of the one that is shown: a model, an example, or a file of the folder.

        What is kept of the old one (drafts, EEPROM images) stays kept; its past is gone. Raises Problem, BenchError;
        the old cell is begun anew then.
        """
        if place in catalogue.MODELS:
            target, is_file = place, False
        else:
            path = self._example(place.removeprefix(EXAMPLE)) if place.startswith(EXAMPLE) else self._folder.path(place)
            target, is_file = str(path), True
        await self._bench.open_another(target)
        self._drafts.belong_to(cell_name(target, is_file=is_file))
        return target

    def _example(self, name: str) -> Path:
        if name not in dict(_cells(home())):
            raise ValueError(f"there is no example {name!r}")
        return home() / name

    async def jacks(self) -> dict[str, dict[str, list[str]]]:
        """For each model, parts too, what wires lead from and to."""
        return jacks()

    async def fittings(self) -> dict[str, object]:
        """What units of a new cell can have: motors, by name; axes of each model that moves something, and programs."""
        return {
            "motors": list(MOTORS),
            "axes": {name: _axes(name) for name in catalogue.MODELS},
            "programs": [name for name, model in catalogue.MODELS.items() if model.language is not None],
        }

    async def new_cell(self, cell: NewCell, name: Name = "") -> str:
        """The cell file of what was chosen, for a file of that name. Raises ValueError with what is wrong."""
        return cell.text(self._beside(name))

    def _beside(self, name: str) -> Callable[[str], str]:
        """Reads files that a cell file of that name would name."""
        return lambda file: self._folder.read_text(str(Path(name).parent / file))

    async def save_cell(self, name: Name, cell: NewCell, over: bool = False) -> str:
        """Write a new cell into the folder, never over a file unless `over` says so. Returns its name."""
        name = name if name.endswith(".toml") else f"{name}.toml"
        text = cell.text(self._beside(name))
        if self._folder.path(name).exists() and not over:
            raise FileExistsError(f"{name} is there already: give it another name, or say that it may be replaced")
        self._folder.write(name, text.encode())
        return name

    async def command_reference(self, model: Name) -> list[dict[str, str]]:
        """The commands of a model, from its table."""
        return [
            {"command": row.command, "argument": row.argument, "what": row.what, "section": row.section}
            for row in catalogue.model(model).commands()
        ]


def _axes(model: str) -> list[str]:
    """The names of the axes of a unit alone; "" for a single one."""
    cell = build(single(model), lambda file: "")
    return [axis for unit in cell.controllers().values() for axis in unit.axes]


def _cells(root: Path, names: list[str] | None = None) -> list[tuple[str, str]]:
    """The cell files below `root`, each with its title; of other files only those are looked at that say `units`."""
    found = []
    for name in names if names is not None else sorted(str(path.relative_to(root)) for path in root.rglob("*.toml")):
        try:
            text = read_text(root / name)
            if "[units" in text:
                found.append((name, parse(text, name).title or name))
        except (OSError, ValueError):  # a Problem is a ValueError: it is told when it is opened
            continue
    return found
