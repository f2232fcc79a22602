"""What a benchmark reports: a number, beside a baseline measured in the same run."""

from collections.abc import Callable, Sequence
from statistics import median
from time import perf_counter, process_time
from typing import NamedTuple


class Row(NamedTuple):
    """One measured number; `target` is the least (or, for times, the most) that will do, None for a mere fact."""

    name: str
    value: float
    unit: str
    baseline_name: str
    baseline_value: float
    target: float | None


def measure(fn: Callable[[], object], repeat: int = 5) -> float:
    """The median of `repeat` runs of `fn` in seconds, after one that does not count."""
    fn()
    times = []
    for _ in range(repeat):
        begin = perf_counter()
        fn()
        times.append(perf_counter() - begin)
    return median(times)


def least(fn: Callable[[], object], repeat: int = 5) -> float:
    """The least processor time of `repeat` runs of `fn` in seconds, after one that does not count.

    For what waits for nothing: it is nearly the same on a machine that has much else to do.
    """
    fn()
    times = []
    for _ in range(repeat):
        begin = process_time()
        fn()
        times.append(process_time() - begin)
    return min(times)


def alternately(*fns: Callable[[], object], repeat: int = 5) -> list[float]:
    """As `least`, for each of `fns`: in turns, so that all of them meet the same machine."""
    for fn in fns:
        fn()
    times: list[list[float]] = [[] for _ in fns]
    for _ in range(repeat):
        for fn, taken in zip(fns, times, strict=True):
            begin = process_time()
            fn()
            taken.append(process_time() - begin)
    return [min(taken) for taken in times]


def print_table(rows: Sequence[Row]) -> None:
    """Print the rows, aligned, each with its ratio to the baseline and its target."""
    print(f"{'':48} {'value':>12} {'unit':10} {'ratio':>8}  {'baseline':36} {'target':>9}")
    for row in rows:
        ratio = row.value / row.baseline_value if row.baseline_value else float("nan")
        target = "" if row.target is None else f"{row.target:9.4g}"
        baseline = f"{row.baseline_name} {row.baseline_value:.4g}"
        print(f"{row.name:48} {row.value:12.4g} {row.unit:10} {ratio:8.3f}  {baseline:36} {target:>9}")
