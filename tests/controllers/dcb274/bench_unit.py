"""One DCB-274 on a test bench: told the time, typed to, its outputs kept."""

from typing import Any, TypeVar

from detent.controllers.dcb274.firmware import Dcb274
from detent.controllers.device import Output, StoreImage
from detent.pins import Level
from detent.uart import Char, Sent

T = TypeVar("T")


class Bench:
    """A unit that is on and signed on. Characters take no time."""

    def __init__(self, *, watched: str = "", **options: Any) -> None:
        self.unit = Dcb274(line_timing=False, **options)
        if watched:
            self.unit.watch(watched)
        self.now = 0
        self.out: list[Output] = []
        self.unit.power(True, 0)
        self.say(" ")

    def collect(self) -> None:
        while out := self.unit.drain():
            self.out += out
            for item in out:
                if isinstance(item, StoreImage):
                    self.unit.stored(True, self.now)

    def run_to(self, until: int) -> None:
        while (at := self.unit.next_deadline()) is not None and at <= until:
            self.now = at
            self.unit.advance(at)
            self.collect()
        self.now = until

    def say(self, text: str) -> None:
        self.unit.receive("RX", [Char(ord(c)) for c in text], self.now)
        self.collect()

    def do(self, *lines: str, wait: int = 2_000_000_000) -> str:
        """Type lines, each with time to be obeyed; what came back for the last one."""
        before = len(self.out)
        for line in lines:
            before = len(self.out)
            self.say(line + "\r")
            self.run_to(self.now + wait)
        return "".join(chr(o.char.value) for o in self.out[before:] if isinstance(o, Sent))

    def pin(self, name: str, level: Level) -> None:
        self.unit.set_pin(name, level, self.now)
        self.collect()

    def of(self, kind: type[T]) -> list[T]:
        return [item for item in self.out if isinstance(item, kind)]

    @property
    def position(self) -> int:
        return self.unit.status(self.now).position
