"""``make fuzz``: units, whole cells and everything that reads, under streams made by number, for so many frames.

A case that fails is made small and written to `tests/proofs/cases`, where `test_fuzz` plays it from then on.
"""

import json
import os
import re
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from itertools import count
from pathlib import Path
from typing import Any, Final

from tests.controllers.laws.bench import Action, Power, Put, Raw, Say, Wait
from tests.proofs import cells, parsers, units
from tests.proofs.tally import Tally

CASES: Final = Path(__file__).parent / "cases"
BATCH: Final = {"unit": 100, "cell": 5, "read": 200}  # cases that a process does in one go: a second or so
SHARE: Final = {"unit": 0.75, "cell": 0.2, "read": 0.05}  # of the time
TRIES: Final = 300  # of making a case smaller
_KINDS: Final = {kind.__name__: kind for kind in (Say, Raw, Put, Power, Wait)}


def targets() -> list[str]:
    """Everything that is held against something: ``unit dcb-274``, ``cell``, ``read motors``."""
    return [*(f"unit {name}" for name in units.BY_NAME), "cell", *(f"read {name}" for name in parsers.TARGETS)]


def batch(target: str, first: int, most: int) -> Tally:
    """The cases `first` to `first + most - 1` of a target, in this process."""
    kind, _, name = target.partition(" ")
    tally = Tally()
    for number in range(first, first + most):
        tally.cases += 1
        try:
            if kind == "unit":
                units.check(units.case(name, number), tally)
            elif kind == "cell":
                cells.check(number, tally)
            else:
                parsers.check(name, number, tally)
        except Exception as error:
            tally.failures.append(keep(target, number, error))
    return tally


def run(
    seconds: float, frames: int, jobs: int, first: int = 0, tell: Callable[[str], None] = print
) -> dict[str, Tally]:
    """Fuzz until one of both is reached, on so many processes; the tallies by target."""
    found = {target: Tally() for target in targets()}
    spent = dict.fromkeys(found, 0.0)  # seconds of a core
    numbers: dict[str, Iterator[int]] = {target: count(first, BATCH[_kind(target)]) for target in found}
    began = told = time.monotonic()
    with ProcessPoolExecutor(jobs) as pool:
        pending: dict[Future[tuple[Tally, float]], str] = {}

        def submit() -> None:
            target = due(spent)
            spent[target] += 1e-3  # what is under way counts a little, so that the next process takes another
            pending[pool.submit(_timed, target, next(numbers[target]), BATCH[_kind(target)])] = target

        for _ in range(jobs + 1):
            submit()
        while pending:
            done = next(iter(pending))  # in the order in which they were begun
            tally, took = done.result()
            target = pending.pop(done)
            found[target].add(tally)
            spent[target] += took
            now = time.monotonic()
            total = sum(one.frames for one in found.values())
            if now - began < seconds and total < frames:
                submit()
            if now - told > 10:
                told = now
                share = max((now - began) / seconds, total / frames)
                left = max((now - began) * (1 / share - 1), 0.0)
                tell(f"{total:,} frames, {share:.0%}, about {left / 60:.0f} min left")
    return found


def due(spent: Mapping[str, float]) -> str:
    """The target whose turn it is: of the kind that is furthest behind its share, the one with the least so far."""
    kinds = {kind: sum(took for target, took in spent.items() if _kind(target) == kind) for kind in SHARE}
    kind = min(kinds, key=lambda one: kinds[one] / SHARE[one])
    return min((target for target in spent if _kind(target) == kind), key=lambda one: spent[one])


def _kind(target: str) -> str:
    return target.partition(" ")[0]


def _timed(target: str, first: int, most: int) -> tuple[Tally, float]:
    began = time.process_time()
    return batch(target, first, most), time.process_time() - began


# -- cases that failed --------------------------------------------------------------------------------------


def keep(target: str, number: int, error: Exception) -> str:
    """Write a case that failed, as small as it goes; the name of its file."""
    kind, _, name = target.partition(" ")
    case: dict[str, Any] = {"target": target, "number": number}
    if kind == "unit":
        case["actions"] = [_plain(action) for action in _smaller(units.case(name, number), error).actions]
    elif kind == "read":
        case["data"] = parsers.data(name, number).hex()
    last = traceback.extract_tb(error.__traceback__)[-1]
    case["error"] = f"{type(error).__name__}: {str(error)[:300]} ({Path(last.filename).name}:{last.lineno})"
    CASES.mkdir(exist_ok=True)
    path = CASES / f"{re.sub('[^a-z0-9]+', '-', target.lower())}-{number}.json"
    path.write_text(json.dumps(case, indent=1) + "\n")
    return path.name


def replay(path: Path) -> None:
    """Play a case that once failed. Raises what it fails with."""
    case = json.loads(path.read_text())
    kind, _, name = case["target"].partition(" ")
    if kind == "unit":
        actions = tuple(_KINDS[action[0]](*(bytes.fromhex(v[1:]) if isinstance(v, str) and v[:1] == "#" else v
                                        for v in action[1:])) for action in case["actions"])  # fmt: skip
        units.check(units.Case(name, case["number"], actions), Tally())
    elif kind == "cell":
        cells.check(case["number"], Tally())
    else:
        parsers.check_data(name, bytes.fromhex(case["data"]), Tally())


def _plain(action: Action) -> list[Any]:
    return [type(action).__name__, *("#" + value.hex() if isinstance(value, bytes) else value for value in action)]


def _smaller(case: units.Case, error: Exception) -> units.Case:
    """The same failure with fewer actions: halves and quarters and single ones are left out as long as it stays."""
    tries, size = TRIES, max(len(case.actions) // 2, 1)
    while tries > 0:
        found = False
        for place in range(0, len(case.actions), size):
            shorter = case._replace(actions=case.actions[:place] + case.actions[place + size :])
            tries -= 1
            try:
                units.check(shorter, Tally())
            except Exception as other:
                if type(other) is type(error):
                    case, found = shorter, True
                    break
            if tries <= 0:
                break
        if not found and size == 1:
            break
        if not found:
            size = max(size // 2, 1)
    return case


# -- the command --------------------------------------------------------------------------------------------


def print_table(found: dict[str, Tally], seconds: float) -> None:
    """One row a target, and their sum."""
    total = Tally()
    columns = ("cases", "frames", "events", "pulses", "images", "refused", "copies", "replays", "stops")
    print(f"{'':32}" + "".join(f"{name:>15}" for name in (*columns, "failures")))
    for target, tally in found.items():
        if tally.cases:
            print(f"{target:32}" + "".join(f"{getattr(tally, n):15,}" for n in columns) + f"{len(tally.failures):15,}")
        total.add(tally)
    print(f"{'all':32}" + "".join(f"{getattr(total, n):15,}" for n in columns) + f"{len(total.failures):15,}")
    print(f"{total.frames:,} frames in {seconds:.0f} s on {os.cpu_count()} cores")
    for failure in total.failures[:20]:
        print(f"failed: tests/proofs/cases/{failure}", file=sys.stderr)
