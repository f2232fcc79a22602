"""What the page Begin asks of the server: what can be opened, opening it, making a new cell, looking commands up."""

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from detent.cell.build import build
from detent.cell.description import parse, single
from detent.controllers import catalogue
from detent.controllers.catalogue import NO_LIMITS
from detent.controllers.genstepper.supply import MOTOR_VOLTS
from detent.motors.named import MOTORS
from detent.realtime.examples import home
from detent.realtime.images import cell_name
from detent.realtime.texts import read_text
from detent.workbench.answers import Command, Fittings, Places
from detent.workbench.beside import beside
from detent.workbench.drafts import Drafts
from detent.workbench.folder import Folder
from detent.workbench.live import Live
from detent.workbench.newcell import NewCell, NewMotor, NewUnit, jacks

if TYPE_CHECKING:
    from detent.workbench.client import Bench

Name = Annotated[str, Field(max_length=1000)]
SUPPLY = 24  # V, where a drive controls the current
LEAST = MOTOR_VOLTS[0]  # that the motors of a GenStepper board have
EXAMPLE = "example:"  # before the name of one, where a target is asked for


class Beginning:
    """Offers ``places open_place jacks fittings new_cell save_cell command_reference``."""

    def __init__(self, bench: "Bench", live: Live, folder: Folder, drafts: Drafts) -> None:
        """Cells are opened and saved in `folder`; `drafts` become those of the cell that is opened."""
        self._bench, self._folder, self._drafts = bench, folder, drafts
        self._titles = Titles()
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

    async def places(self) -> Places:
        """What can be opened: models, examples with their titles, cells in the folder; which is open."""
        examples, cells = await beside(self._read)
        return {
            "open": self._bench.picture.target,
            "models": [(name, model.title) for name, model in catalogue.MODELS.items()],
            "examples": [(EXAMPLE + name, title) for name, title in examples],
            "folder": str(self._folder.root),
            "cells": cells,
        }

    def _read(self) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
        """The examples and the cells of the folder, with their titles."""
        root = self._folder.root
        return self._titles.of(home(), _examples()), self._titles.of(root, self._folder.names((".toml",)))

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
        if name not in _examples():
            raise ValueError(f"there is no example {name!r}")
        return home() / name

    async def jacks(self) -> dict[str, dict[str, list[str]]]:
        """For each model, parts too, what wires lead from and to."""
        return await beside(jacks)

    async def fittings(self) -> Fittings:
        """What units of a new cell can have: motors, by name; axes of each model that moves something, and programs.

        `supplies`: the V to begin with for a motor; in `direct` of the models that put the supply through the winding.
        """
        known = {name: motor for name, motor in MOTORS.items() if motor.inertia}  # of others no motion can be computed
        return {
            "motors": list(known),
            "supplies": dict.fromkeys(known, SUPPLY),
            "direct": {name: max(LEAST, round(motor.current * motor.resistance, 1)) for name, motor in known.items()},
            "uncontrolled": await beside(_uncontrolled),
            "axes": await beside(lambda: {name: _axes(name) for name in catalogue.MODELS}),
            "programs": [name for name, model in catalogue.MODELS.items() if model.language is not None],
        }

    async def new_cell(self, cell: NewCell, name: Name = "") -> str:
        """The cell file of what was chosen, for a file of that name. Raises ValueError with what is wrong."""
        return await beside(cell.text, self._beside(name))

    def _beside(self, name: str) -> Callable[[str], str]:
        """Reads files that a cell file of that name would name."""
        return lambda file: self._folder.read_text(str(Path(name).parent / file))

    async def save_cell(self, name: Name, cell: NewCell, over: bool = False) -> str:
        """Write a new cell into the folder, never over a file unless `over` says so. Returns its name."""
        name = name if name.endswith(".toml") else f"{name}.toml"
        text = await beside(cell.text, self._beside(name))
        if self._folder.path(name).is_file() and not over:
            raise FileExistsError(f"{name} is there already: give it another name, or say that it may be replaced")
        self._folder.write(name, text.encode())
        return name

    async def command_reference(self, model: Name) -> list[Command]:
        """The commands of a model, from its table."""
        return [
            {"command": row.command, "argument": row.argument, "what": row.what, "section": row.section}
            for row in catalogue.model(model).commands()
        ]


@cache
def _uncontrolled() -> list[str]:
    """The models that put the supply through the winding, without current control: whose motors it would burn."""
    motor, found = min(MOTORS, key=lambda name: MOTORS[name].current), list[str]()
    for model, known in catalogue.MODELS.items():
        if known.limits.motor_supply == NO_LIMITS.motor_supply:
            continue  # it has no power stage of its own: a drive follows it
        for axis in _axes(model)[:1]:
            unit = NewUnit(name="unit", model=model)
            fitted = NewMotor(unit="unit", axis=axis, motor=motor, supply=SUPPLY)
            try:
                NewCell(units=[unit], motors=[fitted]).text()
            except ValueError:
                found.append(model)
    return found


def _axes(model: str) -> list[str]:
    """The names of the axes of a unit alone; "" for a single one."""
    cell = build(single(model), lambda file: "")
    return [axis for unit in cell.controllers().values() for axis in unit.axes]


def _examples() -> list[str]:
    root = home()
    return sorted(str(path.relative_to(root)) for path in root.rglob("*.toml"))


class Titles:
    """The titles of cell files, each read once for as long as it stays as it is: a folder may have hundreds."""

    def __init__(self) -> None:
        self._known: dict[Path, tuple[tuple[int, int], str | None]] = {}  # None: it is no cell

    def of(self, root: Path, names: Iterable[str]) -> list[tuple[str, str]]:
        """The files of `names` below `root` that are cells, each with its title, or its name."""
        found = ((name, self._title(root / name)) for name in names)
        return [(name, title or name) for name, title in found if title is not None]

    def _title(self, path: Path) -> str | None:
        try:
            status = path.stat()
            version = status.st_mtime_ns, status.st_size
            known = self._known.get(path)
            if known is None or known[0] != version:
                known = self._known[path] = version, _title(path)
            return known[1]
        except OSError:
            return None


def _title(path: Path) -> str | None:
    """The title of a cell file, "" without one; of others only those are looked at that say `units`. OSError."""
    try:
        text = read_text(path)
        return parse(text, path.name).title if "[units" in text else None
    except ValueError:  # a Problem, too: it is told when the file is opened
        return None
