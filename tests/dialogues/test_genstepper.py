"""The dialogues of the BS0610 and BS0710.

Lines differ from those of `reader` in this: `>` sends characters as they are typed, `<` is one line of an answer, or
its prompt, without the CR LF around it. Scenes begin when the board has signed on, 600 ms after power-on.
``expect Y position 5`` is about motor Y.
"""

from pathlib import Path

import pytest
from tests.dialogues.reader import Player, Scene, files, scenes

from detent.cell.cell import Cell
from detent.ticks import MS

ALL = [(path, scene) for path in files("genstepper") for scene in scenes(path.read_text())]
AWAKE = 600 * MS


class BoardPlayer(Player):
    """Plays one scene with a board."""

    def make(self) -> Cell:
        if self.model not in ("bs0610", "bs0710"):
            self.model = "bs0610"
        cell = super().make()
        cell.run_to(AWAKE)
        for line in cell.lines:
            line.take()
        return cell

    def say(self, rest: str) -> None:
        self.send(rest.encode("ascii"))

    def send(self, data: bytes) -> None:
        super().send(data)
        if not self.timed:
            self.cell.run_to(self.cell.now + 2 * MS)  # an answer waits for one character time
            self.listen()

    def wait_for_more(self) -> None:
        self.check(self.cell.step() is not None, f"only {bytes(value for _, value in self.arrived)!r} came")
        self.listen()

    def next_characters(self, count: int | None) -> tuple[bytes, list[int]]:
        assert count is not None
        self.listen()
        while len(self.arrived) < count:
            self.wait_for_more()
        taken, self.arrived = self.arrived[:count], self.arrived[count:]
        return bytes(value for _, value in taken), [at for at, _ in taken]

    def hear(self, rest: str) -> None:
        wanted = rest.encode("ascii")
        while True:
            values = bytes(value for _, value in self.arrived)
            found = values.lstrip(b"\r\n")
            if found.startswith(wanted) or (found and not wanted.startswith(found)):
                break
            self.wait_for_more()
        self.check(found.startswith(wanted), f"{values!r} came")
        del self.arrived[: len(values) - len(found) + len(wanted)]
        while self.arrived and self.arrived[0][1] in b"\r\n":
            del self.arrived[0]

    def nothing_left(self) -> None:
        self.listen()
        self.arrived = [(at, value) for at, value in self.arrived if value not in b"\r\n"]
        super().nothing_left()

    def do_expect(self, rest: str) -> None:
        words = rest.split()
        if words[0] in ("X", "Y"):
            status = self.cell.controller("unit").status(self.cell.now, words[0])
            self.check(str(getattr(status, words[1])) == words[2], f"it is {status}")
        else:
            super().do_expect(rest)


@pytest.mark.parametrize(("path", "scene"), ALL, ids=[f"{path.stem}: {scene.title}" for path, scene in ALL])
def test_the_board_answers_as_its_manual_says(path: Path, scene: Scene) -> None:
    BoardPlayer(scene).play(scene.lines)


def test_every_file_names_its_place_in_the_manual_on_line_1() -> None:
    assert len(files("genstepper")) >= 6
    for path in files("genstepper"):
        first = path.read_text().splitlines()[0]
        assert first.startswith("BS0610/BS0710 manual, page"), path.name
        assert ": " in first, path.name
