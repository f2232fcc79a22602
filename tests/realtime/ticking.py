"""A wall clock and cells made by hand: time passes only when somebody waits."""

import select
from collections.abc import Sequence
from random import Random

from detent.lines.line import Heard
from detent.realtime.pace import WallNs
from detent.ticks import US, Ns
from detent.uart import Chars, characters

UNREAL = 1_000_000  # descriptors from here on are open nowhere
LOOK = 30 * US  # what a look at the descriptors costs


class Wall:
    """A monotonic clock that began long ago, and a `select` on it that oversleeps by up to 200 us."""

    def __init__(self, seed: int = 1) -> None:
        self.now: WallNs = 123_456_789_012_345
        self._random = Random(seed)

    def __call__(self) -> WallNs:
        return self.now

    def wait(
        self, readers: Sequence[int], writers: Sequence[int], _: Sequence[int], seconds: float | None
    ) -> tuple[list[int], list[int], list[int]]:
        assert seconds is not None, "nothing would ever end this sleep"
        self.now += round(seconds * 1e9) + (self._random.randrange(200 * US) if seconds else LOOK)
        return [], [], []


class TickingLine:
    """A line that is behind by what it is told, and whose host hears what is put there."""

    def __init__(self) -> None:
        self.host_busy_until: Ns = 0
        self.heard: list[Heard] = []

    def take(self) -> list[Heard]:
        heard, self.heard = self.heard, []
        return heard


class TickingCell:
    """Has a deadline every `period` and says one character at each; echoes what it is sent at once."""

    def __init__(self, period: Ns | None, lines: int = 1) -> None:
        self.now: Ns = 0
        self.lines = [TickingLine() for _ in range(lines)]
        self.period = period
        self.ticks = 0
        self.sent: list[tuple[Ns, int, Chars]] = []

    def next_event(self) -> Ns | None:
        return None if self.period is None else (self.ticks + 1) * self.period

    def run_to(self, until: Ns) -> None:
        assert until >= self.now, "time went backwards"
        self.now = until
        while (at := self.next_event()) is not None and at <= until:
            self.ticks += 1
            self.say(0, b"t", at)

    def send(self, line: int, data: Chars) -> None:
        self.sent.append((self.now, line, data))
        self.say(line, data, self.now)

    def say(self, line: int, data: Chars, at: Ns) -> None:
        self.lines[line].heard += [Heard(at, char) for char in characters(data)]

    def got(self, line: int = 0) -> bytes:
        return b"".join(bytes(char.value for char in characters(data)) for _, on, data in self.sent if on == line)


class Client:
    """An endpoint without a descriptor: `inbox` is read when the loop is told that `descriptor` is readable."""

    kind, address, dropped = "client", "nowhere", 0

    def __init__(self, descriptor: int = UNREAL) -> None:
        self.descriptor = descriptor
        self.inbox: list[bytes] = []
        self.outbox = b""
        self.heard = 0
        self.rooms: list[bool] = []
        self.alarm: WallNs | None = None
        self.alarms: list[WallNs] = []

    def reading(self, room: bool) -> Sequence[int]:
        self.rooms.append(room)
        del self.rooms[:-10]
        return (self.descriptor,) if room else ()

    def writing(self) -> Sequence[int]:
        return ()

    def deadline(self) -> WallNs | None:
        return self.alarm

    def due(self, wall: WallNs) -> None:
        self.alarms.append(wall)
        self.alarm = None

    def receive(self, descriptor: int, wall: WallNs) -> bytes:
        return self.inbox.pop(0) if self.inbox else b""

    def send(self, data: bytes, wall: WallNs) -> None:
        self.heard += len(data)
        self.outbox = (self.outbox + data)[-20:]

    def flush(self) -> None:
        raise AssertionError("nothing waits here")

    def close(self) -> None:
        pass


def look(
    readers: Sequence[int], writers: Sequence[int], _: Sequence[int], seconds: float | None
) -> tuple[list[int], list[int], list[int]]:
    """A `select` that never sleeps for long, so that a test can look after each step whether it has what it wants."""
    readers = [descriptor for descriptor in readers if descriptor < UNREAL]
    return select.select(readers, writers, (), 0.05 if seconds is None else min(seconds, 0.05))
