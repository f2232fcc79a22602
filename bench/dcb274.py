"""The DCB-274: what an index costs by its length, and 32 axes on one saturated party line."""

import time
from collections.abc import Iterator
from statistics import median
from typing import NamedTuple

from bench.rows import Row, print_table
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.controllers.dcb274.firmware import Dcb274
from detent.ticks import SECOND
from detent.uart import Char

LONG, SHORT = 16_777_215, 1_000
MOVES = 200
POLLED_FOR, PARTS = SECOND // 20, 20  # virtual time
NAMES = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdef"


def rows() -> list[Row]:
    long, short = _indexes()
    lines = _party_line("on", NAMES), _party_line("on", NAMES[:1]), _party_line("off", NAMES)
    turns = [tuple(map(next, lines)) for _ in range(PARTS)]
    share, alone, bare = (min(part.share for part in parts) for parts in zip(*turns, strict=True))
    (_, polls, lost), _, (_, polls_bare, lost_bare) = turns[-1]
    return [
        Row(f"index of {LONG} steps", long, "us", f"of {SHORT} steps", short, 1.2 * short),
        Row(f"{len(NAMES)} axes polled, 460 800 baud, {polls}/s", 100 * share, "% of a core", "all of it", 100, 30),
        Row("the same", 100 * share, "% of a core", "one axis alone on a line", 100 * alone, None),
        Row(f"characters lost in {polls} polls", lost, "", "sent", 3 * polls, 0),
        Row(f"without execution times, {polls_bare}/s", 100 * bare, "% of a core", "all of it", 100, None),
        Row(f"characters lost in {polls_bare} polls", lost_bare, "", "sent", 3 * polls_bare, 0),
    ]


def _indexes() -> tuple[float, float]:
    """Median microseconds of a long and of a short index with everything around it, alternated."""
    unit = Dcb274(line_timing=False, execution_times=False)
    unit.power(True, 0)
    now = _typed(unit, " ", 0)
    times: dict[int, list[int]] = {LONG: [], SHORT: []}
    for move in range(2 * MOVES):
        steps = (LONG, SHORT)[move % 2]
        begin = time.perf_counter_ns()
        now = _typed(unit, f"{'+-'[move // 2 % 2]}{steps:08}\r", now)
        times[steps].append(time.perf_counter_ns() - begin)
    return median(times[LONG]) / 1e3, median(times[SHORT]) / 1e3


def _typed(unit: Dcb274, text: str, now: int) -> int:
    """Type a line and let everything happen that it causes; when that is over."""
    unit.receive("RX", [Char(ord(c)) for c in text], now)
    while (deadline := unit.next_deadline()) is not None:
        now = deadline
        unit.advance(now)
    unit.drain()
    return now


def _cell(times: str, names: str) -> Cell:
    text = []
    for name in names:
        options = f'options = {{ name = "{name}", execution_times = "{times}" }}'
        text += [f"[units.u{ord(name)}]", 'model = "dcb-274"', options, 'straps = { B1 = "high", PARTY = "high" }']
    units = [f"u{ord(name)}" for name in names]
    return build(parse("\n".join([*text, "[lines.bus]", f"units = {units}"]), "bench"), lambda file: "", record=False)


class Part(NamedTuple):
    """Of a line that is polled: the share of a core that a part of it took, and polls and lost characters so far."""

    share: float
    polls: int
    lost: int


def _party_line(times: str, names: str) -> Iterator[Part]:
    """Each axis is asked for its position, one after the other, part after part without an end.

    The host does the handshake: it sends the next character in the instant in which the echo is there, so the line
    never rests but for the axes' own time.
    """
    cell = _cell(times, names)
    polls = lost = 0
    while True:
        begin, start = time.process_time(), cell.now
        while cell.now - start < POLLED_FOR:
            for character in (names[polls % len(names)], "Z", "\n"):
                cell.send(0, character.encode())
                heard = b""
                while not heard.endswith(character.encode()):
                    if cell.step() is None:
                        lost += 1
                        break
                    heard += bytes(each.char.value for each in cell.lines[0].take())
            polls += 1
        yield Part((time.process_time() - begin) / ((cell.now - start) / SECOND), polls, lost)


if __name__ == "__main__":
    print_table(rows())
