"""A board on its line, for tests: what is said and heard, at which time."""

from detent.axis import MotionStarted
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.controllers.device import DriveSet
from detent.ticks import MS, Ns, round_ratio

READY = 300 * MS  # deaf and signing on is over, at 9600 baud without line timing


class Board:
    """A cell with one board, called `board`, that has signed on."""

    def __init__(self, model: str = "bs0610", *, timed: bool = False, toml: str = "", **options: object) -> None:
        chosen = "\n".join(f'{name} = "{value}"' for name, value in options.items())
        text = f'[units.board]\nmodel = "{model}"\n{toml}\n[units.board.options]\n{chosen}'
        self.cell: Cell = build(parse(text, "test"), lambda file: "", line_timing=timed)
        self.timed = timed
        self.unit = self.cell.controller("board")
        self.line = self.cell.lines[0]
        self.cell.run_to(READY if not timed else 600 * MS)
        self.greeting = self.heard()

    def heard(self) -> str:
        return bytes(heard.char.value for heard in self.line.take()).decode("latin-1")

    def send(self, text: str) -> None:
        self.cell.send(0, text.encode("latin-1"))

    def say(self, text: str, wait: Ns = 2 * MS) -> str:
        """Send, wait, and return what was heard."""
        self.heard()
        self.send(text)
        self.cell.run_to(self.cell.now + wait)
        return self.heard()

    def run(self, duration: Ns) -> None:
        self.cell.run_to(self.cell.now + duration)

    def report(self, number: int, axis: str = "X") -> int:
        """One report of one motor, without a motor being selected for longer."""
        text = self.say(f"{axis}{number}?", 100 * MS if self.timed else 2 * MS).strip("\r\n*")
        name, told, value = text.split(",")
        assert (name, told) == (axis, str(number))
        return int(value)

    def pin(self, name: str, level: int) -> None:
        self.cell.set_pin("board", name, level)

    def level(self, pin: str) -> int:
        return self.unit._driver.levels[pin]

    def status(self, axis: str = "X"):
        return self.unit.status(self.cell.now, axis)

    def position(self, axis: str = "X") -> int:
        return self.status(axis).position

    def idle(self, axis: str = "X") -> bool:
        return self.unit._motors[axis].idle

    def until_idle(self, limit: Ns = 100_000_000 * MS) -> Ns:
        while not (self.idle("X") and self.idle("Y")):
            at = self.cell.step()
            assert at is not None
            assert at < limit
        return self.cell.now

    def pulses(self, axis: str = "X") -> list[tuple[int, int]]:
        """Times and directions of all steps so far."""
        found: list[tuple[int, int]] = []
        for span in self.cell.recording.motion("board", self.cell.now, axis):
            if span.last >= span.first:
                found += [(t, span.direction) for t in span.train.times(span.first, span.last).tolist()]
        return found

    def entries(self, kind: type) -> list:
        return [entry for entry in self.cell.recording.of("board") if isinstance(entry, kind)]

    def drives(self, connector: str = "X") -> list[DriveSet]:
        return [told for told in self.entries(DriveSet) if told.connector == connector]

    def motions(self, axis: str = "X") -> list[MotionStarted]:
        return [started for started in self.entries(MotionStarted) if started.axis == axis]


def bits(count: float, baud: int = 9600) -> Ns:
    """Nanoseconds of so many bit times."""
    return round_ratio(round(count * 4) * 10**9, 4 * baud)
