"""The wire between a host and a fake board: virtual time, delays, drift, and what a bad wire does."""

from collections import deque
from collections.abc import Callable, Sequence

from detent.realtime.boards.fake.board import FakeBoard
from detent.realtime.boards.port import PortLost
from detent.realtime.pace import WallNs
from detent.ticks import MS, SECOND, US

Spoil = Callable[[bytes, bool], Sequence[bytes]]
"""What becomes of bytes on their way (True: to the board): [data] as they are, [] lost, [data, data] doubled ..."""

LEAST_SLICE: WallNs = MS // 2  # a served fake is looked at no more often than so


class FakePort:
    """A `Port` to a fake board. `wall` is whatever the caller says it is; the board's ticks follow from it.

    `drift` is how much faster its crystal runs than nominal, in millionths. `delay` is what the wire takes each way.
    """

    def __init__(
        self, board: FakeBoard, *, drift: float = 0.0, delay: WallNs = 100 * US, spoil: Spoil | None = None,
        address: str = "fake:",
    ) -> None:  # fmt: skip
        self.board, self.address = board, address
        self._rate = round(board.frequency * (1_000_000 + drift))  # ticks in a million seconds
        self._delay, self.spoil = delay, spoil
        self._began: WallNs | None = None
        self._first = board.now
        self._to_board: deque[tuple[WallNs, bytes]] = deque()
        self._to_host: deque[tuple[WallNs, bytes]] = deque()
        self.unplugged = False
        self._lost = False

    def tick_at(self, wall: WallNs) -> int:
        """The board's tick at `wall`."""
        if self._began is None:
            self._began = wall
        return self._first + (wall - self._began) * self._rate // (1_000_000 * SECOND)

    def wall_at(self, tick: int) -> WallNs:
        """The first wall time at which the board is at `tick`."""
        assert self._began is not None
        return self._began + -(-(tick - self._first) * 1_000_000 * SECOND // self._rate)

    def stand(self, span: WallNs) -> None:
        """The board's clock stands for so long, and then goes on."""
        assert self._began is not None
        self._began += span

    def run_to(self, wall: WallNs) -> None:
        """Let the board live up to `wall`; what it is sent arrives on the way."""
        while self._to_board and self._to_board[0][0] <= wall:
            at, data = self._to_board.popleft()
            self.board.receive(data, self.tick_at(at))
            self._collect()
        self.board.run_to(self.tick_at(wall))
        self._collect()

    def _collect(self) -> None:
        if self.board.gone:
            self._lost = True
            self._to_host.clear()
            self._to_board.clear()
            return
        for tick, data in self.board.sent:
            for part in (data,) if self.spoil is None else self.spoil(data, False):
                self._to_host.append((self.wall_at(tick) + self._delay, part))
        self.board.sent.clear()

    def reading(self) -> Sequence[int]:
        """No descriptor: see `deadline`."""
        return ()

    def writing(self) -> Sequence[int]:
        """No descriptor."""
        return ()

    def receive(self, wall: WallNs) -> bytes:
        """What the board has said by now. PortLost."""
        if self.unplugged or self._lost:
            self._lost = True
            raise PortLost(f"{self.address} is gone")
        self.run_to(wall)
        if self._lost:
            raise PortLost(f"{self.address} is gone")
        data = bytearray()
        while self._to_host and self._to_host[0][0] <= wall:
            data += self._to_host.popleft()[1]
        return bytes(data)

    def send(self, data: bytes, wall: WallNs) -> None:
        """Bytes to the board. PortLost."""
        if self.unplugged or self._lost:
            self._lost = True
            raise PortLost(f"{self.address} is gone")
        self.tick_at(wall)
        for part in (data,) if self.spoil is None else self.spoil(data, True):
            self._to_board.append((wall + self._delay, part))

    def flush(self) -> None:
        """Nothing ever waits here."""

    def deadline(self) -> WallNs | None:
        """When something comes from the board, or may come: when it next does anything at all."""
        if self._began is None or self.unplugged or self._lost:
            return None
        times = [queue[0][0] for queue in (self._to_host, self._to_board) if queue]
        timer = self.board.next_timer()
        if timer is not None:
            times.append(max(self.wall_at(timer), self.wall_at(self.board.now) + LEAST_SLICE))
        return min(times, default=None)

    def reopen(self) -> bool:
        """Plug it in again, if it can be."""
        if self.unplugged:
            return False
        self._lost = self.board.gone = False
        self._to_host.clear()
        self._to_board.clear()
        return True

    def close(self) -> None:
        """Let go of it; the board lives on."""
