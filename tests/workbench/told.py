"""A cell with its past and a mirror of it, without a process in between."""

from pathlib import Path

from detent.cell.cell import Cell
from detent.cell.description import Description, parse, single
from detent.cell.history import History
from detent.cell.stores import Stores
from detent.outputs.units import views
from detent.realtime.service import build_with_images
from detent.ticks import Ns
from detent.workbench import look, rotors
from detent.workbench.messages import Happened, Opened
from detent.workbench.mirror import Mirror
from detent.workbench.scope import Scope
from detent.workbench.talk import Talks

EXAMPLES = Path(__file__).parents[2] / "examples"


class Told:
    """The history of a cell, and what a workbench makes of what it is told."""

    def __init__(self, description: Description, folder: Path = EXAMPLES, **options: int) -> None:
        stores = Stores()
        cell = build_with_images(
            description, lambda file: (folder / file).read_text(), None, True, [], True, stores.save
        )  # fmt: skip
        self.history = History(cell, stores, **options)
        self.picture = look.picture(description, "cell", cell, [], [])
        self.mirror = Mirror(Opened(self.picture, {}, views(cell)))
        self.scope = Scope(self.picture, self.mirror)
        self.talks = Talks(self.picture, self.mirror)

    @property
    def cell(self) -> Cell:
        return self.history.cell

    def run(self, until: Ns, step: Ns | None = None) -> None:
        """Let time pass, telling every `step`."""
        while self.history.now < until:
            self.history.run_to(min(until, self.history.now + (step or until)))
            self.tell()

    def tell(self) -> None:
        history = self.history
        found = {
            history.cell.wiring.names[part]: rows
            for part in history.motors
            if not history.past
            and len(rows := rotors.rows(history.cell, part, history.now, first=not self.mirror.until))
        }
        news = history.news()
        if news.cut is not None:
            self.mirror.cut(news.cut)
        self.mirror.take(Happened(news.first, news.batches, news.actions, found, history.first_batch))
        self.mirror.until = history.end


def example(name: str, **options: int) -> Told:
    path = EXAMPLES / name / "cell.toml"
    return Told(parse(path.read_text(), str(path)), path.parent, **options)


def alone(model: str, **straps: int | str) -> Told:
    return Told(single(model, straps=straps))
