"""What comes back from boards, in the order in which it became known."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple, TypeAlias

from detent.ticks import Ns

BY_HAND = "emergency stop"  # the reason of a shutdown that somebody asked for


class Ready(NamedTuple):
    """The board is configured and its inputs are read.

    `restarted`: it had to be configured anew, so that it counts from 0 and nothing is known of where its axes stand.
    Otherwise it was found as a host had left it, and its counts go on. `inputs` are logical levels.
    """

    board: str
    restarted: bool
    inputs: Mapping[str, bool]


class InputChanged(NamedTuple):
    """An input has another (logical) level, for two polls: known `at` board ns, the time of the report."""

    board: str
    input: str
    level: bool
    at: Ns


class Stopped(NamedTuple):
    """The firmware has stopped a stepper because an input took the level for which it was armed.

    `at` is the cell time of the stop (its tick, less lead and lag): no pulse came behind it, and all before it came.
    `edge` is that of the first sample which showed the level. `shaft` is the firmware's count as a shaft position.
    `present` is the level of the input, which was asked for afterwards: a glitch may be over. `levels` are those of
    every input that may stop this stepper, asked for together: while it stands, what follows it stands as well. One
    that was reported to have changed since has its newest level.
    `dry`: no input has stopped it, but its next pulses did not come in time; it happened about one of these cell times.
    """

    board: str
    stepper: str
    input: str
    level: bool
    at: Ns
    edge: Ns
    shaft: int
    present: bool
    levels: Mapping[str, bool] = MappingProxyType({})
    dry: tuple[Ns, ...] = ()


class Slipped(NamedTuple):
    """A batch was late: every pulse of its unit from cell time `at` on that has not left comes `by` later than before.

    `stepper` is the axis that was the latest.
    """

    board: str
    stepper: str
    at: Ns
    by: Ns


class OutputLate(NamedTuple):
    """The change of an output for cell time `at` came later than its unit does, by so many ns, as the computer did."""

    board: str
    out: str
    at: Ns
    by: Ns


class CountDiffers(NamedTuple):
    """At rest the firmware has counted `counted` where the pulses that were sent make `shaft`."""

    board: str
    stepper: str
    shaft: int
    counted: int


class CountEnds(NamedTuple):
    """The firmware stopped a stepper near the end of its count: where it stands nobody can tell."""

    board: str
    stepper: str


class ShutDown(NamedTuple):
    """The firmware has shut down: outputs at `off`, steppers still, nothing is carried out until `Board.recover`."""

    board: str
    reason: str


class Recovered(NamedTuple):
    """A board that was shut down, lost or restarted is ready again.

    `shafts` says for each stepper what the firmware has counted as a shaft position; None where it is not known any
    more, because the board was restarted. Motors may have lost steps in either case. Call `Stepper.rewind` (or
    `adopt`) for each before anything moves.
    """

    board: str
    shafts: Mapping[str, int | None]
    inputs: Mapping[str, bool]


class Lost(NamedTuple):
    """The board does not answer any more, or its descriptor is gone. Its steppers end within the lead."""

    board: str
    reason: str


class DriverFault(NamedTuple):
    """A driver chip does not answer, does not keep what is written to it, or reports a fault."""

    board: str
    driver: str
    reason: str


class DriverSet(NamedTuple):
    """A driver chip has taken the settings last commanded, read back."""

    board: str
    driver: str
    what: str


class Refusal(NamedTuple):
    """The board cannot be used so: `item`, `key` of the setup at fault (empty: the board), why and what to do.

    One that is `passing` may be over without another file or firmware: whoever waits asks again.
    """

    board: str
    item: str
    key: str
    text: str
    passing: bool = False


Event: TypeAlias = (
    Ready | InputChanged | Stopped | Slipped | OutputLate | CountDiffers | CountEnds | ShutDown | Recovered
    | Lost | DriverFault | DriverSet | Refusal
)  # fmt: skip
