"""The verb `bench`: how quickly a unit answers, and how much a link carries."""

import json as json_text
from typing import TYPE_CHECKING, NamedTuple

from detent.cli.unit import NO_UNIT_OPTIONS, ModelName, PortName, UnitOptions

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from detent.hosts.exchange import Port

QUESTIONS = {
    "gs-c200": "V1",
    "gs-c200s": "V1",
    "dcb-274": "^",
    "bs0610": "-1?",
    "bs0710": "-1?",
    "supersigma": "status",
}
"""What each model answers at any time, and what changes nothing."""


def bench(
    model: ModelName,
    port: PortName,
    *,
    count: int = 200,
    json: bool = False,
    unit: UnitOptions = NO_UNIT_OPTIONS,
) -> None:
    """Measure reply times and throughput of a link.

    The question changes nothing in the unit. The reply time is from the first character handed over to the last one
    of the answer. What a serial line needs for the characters themselves is part of it.

    For example: `detent bench gs-c200 /dev/ttyUSB0 --count 50`

    Parameters
    ----------
    count
        How many times it is asked.
    json
        Print the result as one line of JSON, times in seconds.
    """
    from time import perf_counter

    from detent.cli.endings import asked_wrongly
    from detent.cli.unit import progress
    from detent.cli.unit import unit as connected
    from detent.hosts.exchange import Progress
    from detent.hosts.typed import say

    if count < 1:
        asked_wrongly(ValueError(f"--count {count}: ask at least once"))
    with connected(model, port, unit) as found, progress(f"asking {model}") as watch:
        question = QUESTIONS[model]
        found.perform(say(found.driver, question))  # signs on where that is needed
        counted = found.port = _Counted(found.port)
        times = []
        for done in range(count):
            watch(Progress(done, count))
            begin = perf_counter()
            found.perform(say(found.driver, question))
            times.append(perf_counter() - begin)
    measured = Measured(model, port, question, sorted(times), counted.sent, counted.received)
    print(json_text.dumps(measured.facts()) if json else measured)


class Measured(NamedTuple):
    """Reply times in seconds, in order, and the characters that went each way."""

    model: str
    port: str
    question: str
    times: list[float]
    sent: int
    received: int

    def percentile(self, percent: float) -> float:
        """The time within which so many percent of the answers came."""
        return self.times[min(round(percent / 100 * len(self.times)), len(self.times) - 1)]

    def facts(self) -> dict[str, object]:
        """What `--json` tells."""
        total = sum(self.times)
        return {
            "model": self.model,
            "port": self.port,
            "question": self.question,
            "count": len(self.times),
            "seconds": {
                "min": self.times[0],
                "median": self.percentile(50),
                "p99": self.percentile(99),
                "max": self.times[-1],
            },
            "exchanges_per_second": len(self.times) / total,
            "characters_per_second": {"sent": self.sent / total, "received": self.received / total},
        }

    def __str__(self) -> str:
        """As people read it."""
        total = sum(self.times)
        named = {
            "min": self.times[0],
            "median": self.percentile(50),
            "99 %": self.percentile(99),
            "max": self.times[-1],
        }
        times = ", ".join(f"{name} {seconds * 1e3:.3f} ms" for name, seconds in named.items())
        return (
            f"{len(self.times)} times {self.question} to the {self.model} at {self.port}\n"
            f"reply       {times}\n"
            f"throughput  {len(self.times) / total:.0f} exchanges/s, "
            f"{self.sent / total:.0f} characters/s sent, {self.received / total:.0f} received"
        )


class _Counted:
    """A port, and how many characters have gone over it each way."""

    def __init__(self, port: "Port") -> None:
        self._port = port
        self.sent = self.received = 0
        self.keep, self.wait, self.clock, self.close = port.keep, port.wait, port.clock, port.close

    def write(self, data: bytes, /) -> None:
        self.sent += len(data)
        self._port.write(data)

    def receive(self, timeout: float, /) -> bytes:
        data = self._port.receive(timeout)
        self.received += len(data)
        return data

    def turn(self) -> "AbstractContextManager[object]":
        return self._port.turn()
