"""A script for a line: command lines that are sent one after the other, with pauses in the time of the cell.

One command a line, as it is typed; ``;`` begins a comment. ``@ 500 ms`` (or ``@ 0.5``, in seconds) is a pause, and
``@ answer`` waits until somebody has answered on the line since the last command; ``@ again`` begins anew from the
first line. A script waits while the cell stands, and stops where a unit refuses a command; behind real pins also where
an axis stands at fault, as it does after STOP: nothing of it is sent behind that, nor when somebody says Recover.
"""

import asyncio
import contextlib
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from detent.realtime.boards.states import Standing
from detent.ticks import MS, Ns, parse_duration
from detent.workbench.live import Live, Value
from detent.workbench.messages import State
from detent.workbench.words import check_typed

if TYPE_CHECKING:
    from detent.workbench.client import Bench

MOST_LINES = 10_000


class Pause(NamedTuple):
    """Wait so long in the time of the cell; `steady`: from when the last such pause should have ended."""

    line: int
    length: Ns
    steady: bool = False


class Answered(NamedTuple):
    """Wait for an answer."""

    line: int


class Again(NamedTuple):
    """Begin anew."""

    line: int


class Command(NamedTuple):
    """Send a command line."""

    line: int
    text: str


Step = Pause | Answered | Again | Command

LEAST_INTERVAL: Ns = 10 * MS  # between two of a command that is repeated
SETTLED: Ns = 30 * MS  # behind the last character: by then a unit has turned down what it does not take


def parse(text: str, comment: str = ";") -> list[Step]:
    """The steps of a script, each with its line from 1. Raises ValueError with the line and the remedy."""
    steps: list[Step] = []
    for number, written in enumerate(text.splitlines(), 1):
        line = written.partition(comment)[0].strip() if comment else written.strip()
        if not line:
            continue
        if not line.startswith("@"):
            try:
                steps.append(Command(number, check_typed(line)))
            except ValueError as error:
                raise ValueError(f"line {number}: {error}") from None
        elif line[1:].strip().lower() == "answer":
            steps.append(Answered(number))
        elif line[1:].strip().lower() == "again":
            if not any(isinstance(step, (Pause, Answered)) for step in steps):
                raise ValueError(f"line {number}: @ again needs a pause before it; write @ 500 ms, say")
            steps.append(Again(number))
        else:
            try:
                steps.append(Pause(number, parse_duration(line[1:].strip())))
            except ValueError:
                what = f"line {number}: {line!r} is no pause; write @ 500 ms, @ 0.5 (seconds), @ answer or @ again"
                raise ValueError(what) from None
    if len(steps) > MOST_LINES:
        raise ValueError(f"{len(steps)} lines are too many; at most {MOST_LINES}")
    return steps


def at_fault(state: State) -> bool:
    """Whether an axis behind real pins stands until somebody says Recover."""
    return state.real is not None and state.real.standing == Standing.FAULT.value


class LineScripts:
    """Runs one script at a time on each line of a bench, and shows in `live` (``script.LINE``) how far it is."""

    def __init__(self, bench: "Bench", live: Live) -> None:
        self._bench, self._live = bench, live
        self._running: dict[str, asyncio.Task[None]] = {}
        self._runs = 0

    def start(self, line: str, unit: str, text: str, comment: str = ";") -> None:
        """Run the script `text` on a line, its commands to `unit`. Raises ValueError, KeyError."""
        steps = parse(text, comment)
        if not steps:
            raise ValueError("there is nothing to send; write one command a line")
        self._begin(line, unit, steps)

    def repeat(self, line: str, unit: str, text: str, every: Ns) -> None:
        """Send a command to `unit` again and again, at an interval that does not drift. Raises ValueError, KeyError."""
        if every < LEAST_INTERVAL:
            raise ValueError(f"a command is sent again every {LEAST_INTERVAL / MS:g} ms at the most: write 0.1, say")
        self._begin(line, unit, [Command(1, check_typed(text)), Pause(1, every, steady=True), Again(1)])

    def _begin(self, line: str, unit: str, steps: list[Step]) -> None:
        units = self._bench.picture.lines[line].units
        if unit not in units:
            raise ValueError(f"{unit} is not on line {line}; there are: {', '.join(units)}")
        self.stop(line)
        self._running[line] = asyncio.create_task(self._run(line, unit, steps))

    def stop(self, line: str) -> None:
        """End the script that runs on a line, if one does."""
        task = self._running.pop(line, None)
        if task is not None:
            task.cancel()
            self._tell(line, {"running": False, "line": 0, "told": "stopped"})

    async def _run(self, line: str, unit: str, steps: list[Step]) -> None:
        told, at, place = "done", 0, 0
        bench = self._bench
        self._runs += 1
        who = f"script {self._runs}"
        due = since = bench.state.now
        try:
            while place < len(steps):
                step = steps[place]
                at, place = step.line, place + 1
                self._tell(line, {"running": True, "line": at, "told": "", "repeats": isinstance(steps[-1], Again)})
                match step:
                    case Again():
                        place = 0
                    case Command():
                        error = bench.state.units[unit].error
                        await self._until(lambda state: not state.held)
                        await bench.type(unit, step.text)
                        since = bench.state.now
                        while (quiet := bench.state.speaking[line] + SETTLED) > bench.state.now:
                            await self._pass(who, quiet)
                        if (refused := bench.state.units[unit].error) is not None and refused != error:
                            raise ValueError(f"{unit} refused {refused.frame or step.text}: {refused.reason}")
                    case Pause():
                        now, until = bench.state.now, bench.state.now + step.length
                        due = await self._pass(who, min(max(due + step.length, now), until) if step.steady else until)
                    case Answered():
                        await self._answered(line, since)
        except (ValueError, RuntimeError) as error:
            told = f"line {at}: {error}"
        except KeyError:
            told = f"line {at}: the cell has not this line and this unit any more"
        finally:
            with contextlib.suppress(RuntimeError):
                await bench.alarm(who, None)
        self._running.pop(line, None)
        self._tell(line, {"running": False, "line": at if told != "done" else 0, "told": told})

    async def _pass(self, who: str, until: Ns) -> Ns:
        """Wait until the cell has come to `until`; when that was.

        As fast as it goes, it comes there though nothing is due by then. Where its time goes back, and on from there,
        `until` goes back as well: as much of the pause is left as there was.
        """
        last = self._bench.state.now

        def over(state: State) -> bool:
            nonlocal last
            if state.past:
                return False
            back = state.now < last
            last = last if back else state.now
            return back or state.now >= until

        while True:
            await self._bench.alarm(who, until)
            await self._until(over)
            now = self._bench.state.now
            if now >= until:
                return until
            until, last = until - (last - now), now

    async def _answered(self, line: str, since: Ns) -> None:
        """Wait until somebody has answered on a line behind `since`, or behind where its time has gone back to."""

        def over(state: State) -> bool:
            nonlocal since
            if not state.past:
                since = min(since, state.now)
            return any(row.whole and row.sender and row.end > since for row in self._bench.terminal(line).rows)

        await self._until(over)

    async def _until(self, condition: Callable[[State], bool]) -> None:
        """Wait for it. Raises ValueError once an axis of a machine stands at fault."""
        await self._bench.until(lambda state: at_fault(state) or condition(state))
        real = self._bench.state.real
        if real is not None and at_fault(self._bench.state):
            raise ValueError(f"nothing more is sent, as the machine stands: {real.why}")

    def _tell(self, line: str, how: dict[str, Value]) -> None:
        self._live.put({f"script.{line}": how})
