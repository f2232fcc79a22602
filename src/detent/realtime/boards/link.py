"""Messages to a board in blocks: numbered, acknowledged, sent again where one was lost or damaged.

A board takes blocks in the order of their numbers only, and answers each with a block of the number that it expects
next: an acknowledgement, or, where the number is not behind the last, a request to send again. Several blocks may be
under way. What a board sends is not repeated: whoever needs an answer asks again.

The number at the start is not known, as a board keeps it while hosts come and go: an empty block finds it out.
"""

from collections import deque
from typing import NamedTuple

from detent.realtime.boards.frames import END, LARGEST, ROOM, SEQUENCES, SMALLEST, Block, Reader, block
from detent.realtime.boards.undo import Undo
from detent.realtime.pace import WallNs
from detent.ticks import MS

MOST_UNDER_WAY = 7  # blocks; a board tells 16 apart, and what it said of as many before may come twice
FIRST_PATIENCE: WallNs = 25 * MS  # without an acknowledgement, before blocks are sent again; doubles each time
MOST_PATIENCE: WallNs = 1000 * MS
FILL = bytes((END,)) * LARGEST  # what a board waits for that has got a block with a damaged length
WASTE = 16  # bytes at most that a block has left where the next message does not fit in
NAK_QUIET: WallNs = 3 * MS  # requests that follow each other so closely are about the same loss


class Said(NamedTuple):
    """What a board said, when it knew the first `known` messages of ours."""

    payload: bytes
    known: int


class _Sent(NamedTuple):
    sequence: int  # not wrapped
    data: bytes
    at: WallNs  # first sent
    messages: int  # in it


class Link:
    """Bytes in, payloads out; messages in, bytes out. It is told the time and keeps its own deadlines."""

    def __init__(self) -> None:
        self.window: int | None = None  # bytes under way at most
        self.retransmitted = 0  # blocks
        self.refused = 0  # requests to send again
        self.blocks = 0
        self.bytes_sent = 0
        self._reader = Reader()
        self.reset()

    def reset(self) -> None:
        """Begin anew with a board of which nothing is known; what was to be sent is dropped."""
        self.synced = False
        self._reader = Reader()
        self._next = 0  # number of the next new block, not wrapped
        self._waiting: deque[bytes] = deque()  # messages
        self._under_way: deque[_Sent] = deque()
        self._bytes_under_way = 0
        self._out = bytearray()
        self.said = 0  # messages so far, whether they have left or not
        self.acknowledged = 0  # of these
        self._again_at: WallNs | None = None
        self._patience = FIRST_PATIENCE
        self._repeated_at: WallNs | None = None
        self.heard: WallNs = 0  # what the board had said up to then has come: it acknowledged what was sent then
        self._acked = -1  # the highest number, not wrapped, that came with an empty block
        self._proven = False  # a block of ours was acknowledged under its number

    @property
    def damaged(self) -> int:
        """Blocks of the board that came damaged."""
        return self._reader.damaged

    @property
    def idle(self) -> bool:
        """Whether everything sent is acknowledged, and nothing waits."""
        return not self._waiting and not self._under_way

    @property
    def spare(self) -> int:
        """So many bytes of messages may be sent at once: what waits for an acknowledgement may leave too late."""
        room = self._room(MOST_UNDER_WAY - len(self._under_way), self._bytes_under_way)
        return room - sum(map(len, self._waiting)) if self._waiting else room

    def enough(self, wanted: int) -> bool:
        """Whether so many bytes may be sent at once, or as many as ever may."""
        return self.spare >= min(wanted, self._room(MOST_UNDER_WAY, 0))

    def _room(self, blocks: int, taken: int) -> int:
        """Bytes of messages for which there is room in so many blocks, and in a window of which some is `taken`."""
        room = blocks * ROOM
        if self.window is None:
            return room
        full, rest = divmod(max(self.window - taken, 0), LARGEST - WASTE)
        return min(room, full * (ROOM - WASTE) + max(rest - SMALLEST, 0))

    def sync(self, wall: WallNs) -> None:
        """Ask for the number that the board expects; again until it has answered."""
        self._out += bytes((END,)) + block(0, b"")
        self._again_at = wall + self._patience
        self._patience = min(2 * self._patience, MOST_PATIENCE)

    def send(self, message: bytes) -> None:
        """Queue a message; `flush` makes blocks of what waits."""
        self._waiting.append(message)
        self.said += 1

    def drop_waiting(self) -> None:
        """Forget what has not been given a number yet: something more urgent comes."""
        self.said -= len(self._waiting)
        self._waiting.clear()

    def flush(self, wall: WallNs) -> None:
        """Make blocks of what waits, as many as may be under way."""
        if not self.synced:
            return
        while self._waiting and len(self._under_way) < MOST_UNDER_WAY:
            payload = bytearray()
            count = 0
            for message in self._waiting:
                if len(payload) + len(message) > ROOM:
                    break
                payload += message
                count += 1
            if not count:
                raise ValueError(f"a message of {len(self._waiting[0])} bytes is longer than a block")
            data = block(self._next, bytes(payload))
            if self.window is not None and self._under_way and self._bytes_under_way + len(data) > self.window:
                break
            for _ in range(count):
                self._waiting.popleft()
            self._under_way.append(_Sent(self._next, data, wall, count))
            self._bytes_under_way += len(data)
            self._next += 1
            self._out += data
            self.blocks += 1
            if self._again_at is None:
                self._again_at = wall + self._patience

    def kept(self) -> Undo:
        """As it is now, again, as far as nothing was taken: what is sent and flushed from now on was not."""
        waiting, under_way, out = self._waiting.copy(), self._under_way.copy(), bytes(self._out)
        numbers = self._next, self._bytes_under_way, self._again_at, self.blocks, self.said

        def undo() -> None:
            self._waiting, self._under_way, self._out = waiting, under_way, bytearray(out)
            self._next, self._bytes_under_way, self._again_at, self.blocks, self.said = numbers

        return undo

    def take(self) -> bytes:
        """The bytes to put on the wire."""
        data = bytes(self._out)
        self._out.clear()
        self.bytes_sent += len(data)
        return data

    def receive(self, data: bytes, wall: WallNs) -> list[Said]:
        """What came: the payloads of the board's blocks, in order. Those before it is `synced` are not for us."""
        said = []
        for found in self._reader.feed(data):
            if not self.synced:
                if not found.payload:
                    self._adopt(found.sequence)
                continue
            self._acknowledged(found, wall)
            if found.payload:
                said.append(Said(found.payload, self.acknowledged))
        self.flush(wall)
        return said

    def deadline(self) -> WallNs | None:
        """When `due` wants to be called."""
        return self._again_at

    def due(self, wall: WallNs) -> None:
        """Send again what was not acknowledged in time."""
        if self._again_at is None or wall < self._again_at:
            return
        if not self.synced:
            self.sync(wall)
        elif self._under_way:
            self._out += FILL
            self._repeat(wall)
            self._patience = min(2 * self._patience, MOST_PATIENCE)
            self._again_at = wall + self._patience
        else:
            self._again_at = None

    def _adopt(self, sequence: int) -> None:
        self.synced = True
        self._next = self._acked = sequence
        self._patience = FIRST_PATIENCE
        self._again_at = None

    def _acknowledged(self, found: Block, wall: WallNs) -> None:
        first = self._under_way[0].sequence if self._under_way else self._next
        behind = (found.sequence - first) % SEQUENCES
        if behind == 0:
            # a block with an answer acknowledges too, and the acknowledgement proper follows it: only the second of two
            # empty blocks with one number asks to send again
            if not found.payload and self._acked < first:
                self._acked = first
            elif not found.payload and self._under_way:
                self.refused += 1
                if self._repeated_at is None or wall - self._repeated_at >= NAK_QUIET:
                    self._repeat(wall)
            return
        if behind > len(self._under_way):
            if not self._proven and not found.payload:  # the answer that was adopted was an old one
                self._renumber(found.sequence, wall)
            return  # of an earlier time
        self._proven = True
        if not found.payload:
            self._acked = first + behind
        for _ in range(behind):
            taken = self._under_way.popleft()
            self._bytes_under_way -= len(taken.data)
            self.acknowledged += taken.messages
            self.heard = taken.at
        self._repeated_at = None
        self._patience = FIRST_PATIENCE
        self._again_at = wall + self._patience if self._under_way else None

    def _renumber(self, sequence: int, wall: WallNs) -> None:
        """Nothing has been taken yet, and the board expects another number: begin there."""
        old = list(self._under_way)
        self._under_way.clear()
        self._next = self._acked = sequence
        for sent in old:
            self._under_way.append(_Sent(self._next, block(self._next, sent.data[2:-3]), sent.at, sent.messages))
            self._next += 1
        self._repeat(wall)

    def _repeat(self, wall: WallNs) -> None:
        """Everything under way again, in order."""
        self._out += bytes((END,))  # whatever a damaged block has left behind ends here
        for sent in self._under_way:
            self._out += sent.data
        self.retransmitted += len(self._under_way)
        self._repeated_at = wall
