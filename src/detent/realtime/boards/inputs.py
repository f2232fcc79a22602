"""Inputs: up to eight pins in a group that the firmware polls, and reports when two polls agree."""

from collections.abc import Callable, Sequence

from detent.realtime.boards.core import MASK, Core
from detent.realtime.boards.dictionary import Message, Value
from detent.realtime.boards.setup import InputSetup
from detent.realtime.pace import WallNs
from detent.ticks import MS, Ns

GROUP = 8  # pins that the firmware polls together
POLL: Ns = 1 * MS
POLLS_TO_REPEAT = 30  # a report that is not acknowledged comes again


class Buttons:
    """A group of inputs. `changed` is told the input and its logical level, and when the report came."""

    def __init__(
        self, core: Core, inputs: Sequence[InputSetup], oid: int, changed: Callable[[str, bool, WallNs], None]
    ) -> None:
        self.oid = oid
        self._core, self._inputs, self._changed = core, tuple(inputs), changed
        self._acknowledged = 0
        self._state = 0

    def config(self) -> list[tuple[str, dict[str, Value | str]]]:
        """The commands that make it; pins by name."""
        made: list[tuple[str, dict[str, Value | str]]]
        made = [("config_buttons", {"oid": self.oid, "button_count": len(self._inputs)})]
        for i, entry in enumerate(self._inputs):
            made.append(("buttons_add", {
                "oid": self.oid, "pos": i, "pin": entry.pin.name, "pull_up": entry.pin.pull & 0xFF,
            }))  # fmt: skip
        return made

    def start(self, raw: Sequence[bool], wall: WallNs) -> None:
        """Poll from now on; `raw` are the levels of the pins themselves, as they were just read."""
        core = self._core
        self._state = sum(1 << i for i, level in enumerate(raw) if level)
        self._acknowledged = 0
        core.command("buttons_query", oid=self.oid, clock=core.unhurried(wall) & MASK, rest_ticks=core.ticks(POLL),
                     retransmit_count=POLLS_TO_REPEAT, invert=self._state)  # fmt: skip

    def reported(self, message: Message, wall: WallNs) -> None:
        """A buttons_state came: what is new in it, in order."""
        states = message.data("state")
        new = states[(self._acknowledged - message.number("ack_count")) & 0xFF :]
        if not new:
            return
        self._acknowledged = self._acknowledged + len(new) & 0xFF
        self._core.command("buttons_ack", oid=self.oid, count=len(new))
        for state in new:
            changed, self._state = state ^ self._state, state
            for i, entry in enumerate(self._inputs):
                if changed >> i & 1:
                    self._changed(entry.name, bool(state >> i & 1) is not entry.pin.active_low, wall)
