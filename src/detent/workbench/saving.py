"""Keeping a program by the unit's own command: sent on its line, and what comes of it."""

from collections.abc import Awaitable, Callable
from typing import Final, Protocol

from detent.ticks import SECOND, Ns
from detent.workbench.messages import State

PATIENCE: Final[Ns] = 2 * SECOND  # of the cell, for an answer to the command


class Waited(Protocol):
    """As much of a bench as this needs."""

    state: State

    async def alarm(self, who: str, at: Ns | None) -> None:
        """As `Bench.alarm`."""

    async def until(self, condition: Callable[[State], bool]) -> State:
        """As `Bench.until`."""
        ...


async def saved(bench: Waited, unit: str, send: Callable[[], Awaitable[int]]) -> tuple[bool, str]:
    """`send` the command, which gives how often `unit` had written before; whether it is well, and what came of it.

    While the cell is held the command waits on the line; the text then says so. Not well: it was refused, or nothing
    was answered within `PATIENCE`. Raises what `send` does, BenchError where the engine ends.
    """
    before = bench.state.units[unit].error
    written = await send()
    sent = bench.state.now

    def over(state: State) -> bool:
        now = state.units[unit]
        return now.stored > written or now.error != before or state.held or state.now > sent + PATIENCE

    await bench.alarm(f"save {unit}", sent + PATIENCE + 1)
    state = await bench.until(over)
    await bench.alarm(f"save {unit}", None)
    now = state.units[unit]
    if now.stored > written:
        return True, f"{unit} has kept its program"
    if now.error is not None and now.error != before:
        return False, f"{unit} refused it: {now.error.reason}"
    if state.held:
        return True, f"the command is on its way to {unit}: it keeps its program when the cell goes on"
    return False, f"{unit} does not answer: see whether it is switched on, and not busy"
