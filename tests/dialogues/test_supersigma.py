"""The dialogues of the SUPERSIGMA drive. They are written in bytes, as the paper's table 1 has them.

Lines differ from those of `reader` in this: `>` and `<` have bytes in hex, of the CCU and of the drives, and
`units one=1 two=2` gives drives their numbers on one MICROBUS.
"""

from pathlib import Path

import pytest
from tests.dialogues.reader import Player, Scene, files, scenes

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse

ALL = [(path, scene) for path in files("supersigma") for scene in scenes(path.read_text())]


class BusPlayer(Player):
    """Plays one scene on a MICROBUS."""

    def make(self) -> Cell:
        numbers = self.addresses or {"unit": int(self.options.get("number", 1))}
        text = []
        for name, number in numbers.items():
            text += [f"[units.{name}]", 'model = "supersigma"', f"powered = {str(self.powered).lower()}"]
            options = {**self.options, "number": number}
            text += [f"[units.{name}.options]", *(f'{option} = "{value}"' for option, value in options.items())]
        text += ["[lines.microbus]", f"units = {list(numbers)}", *self.toml]
        return build(parse("\n".join(text), "dialogue"), lambda file: "", line_timing=self.timed)

    def say(self, rest: str) -> None:
        self.send(bytes.fromhex(rest))

    def hear(self, rest: str) -> None:
        wanted = bytes.fromhex(rest)
        data, _ = self.next_characters(len(wanted))
        self.check(data == wanted, f"{data.hex(' ')} came")

    def do_wait(self, rest: str) -> None:
        """`wait rest` lets what the CCU is sending reach the drives, and then the movement of the first of them end."""
        if rest != "rest":
            super().do_wait(rest)
            return
        unit, _ = self.target("")
        self.cell.run_to(max(self.cell.now, self.cell.lines[0].host_busy_until))
        while self.level(unit, "P23"):
            self.check(self.cell.step() is not None, "it never comes to rest")
        self.listen()


@pytest.mark.parametrize(("path", "scene"), ALL, ids=[f"{path.stem}: {scene.title}" for path, scene in ALL])
def test_the_drive_does_as_the_paper_says(path: Path, scene: Scene) -> None:
    BusPlayer(scene).play(scene.lines)


def test_every_file_names_its_place_in_the_paper_on_line_1() -> None:
    for path in files("supersigma"):
        first = path.read_text().splitlines()[0]
        assert first.startswith("Cassinis, "), path.name
        assert ": " in first, path.name
