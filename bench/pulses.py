"""How fast pulse trains are made, asked and materialised. Run: python -m bench.pulses (from the repository).

Every row has a baseline of the same run, because machines differ: a plain fill of an int64 array where pulses
are materialised, an exact integer square root or a bisection of a plain list where single questions are asked.
"""

from bisect import bisect_right
from collections.abc import Callable
from fractions import Fraction
from functools import partial
from importlib.util import find_spec
from math import isqrt
from time import process_time

import numpy as np
import numpy.typing as npt

from bench.rows import Row, least, measure, print_table
from detent.pulses import Accelerating, Table, Ticked, Train, Uniform, arrays
from detent.ramps.constant_acceleration import move
from detent.ticks import SECOND, to_fixed

DENSE = 10_000_000  # steps of the long trains
MEGA = 1e6


def rows() -> list[Row]:
    return [*dense_rows(), *move_rows(), *query_rows()]


def dense_rows() -> list[Row]:
    """Step times materialised into a buffer that is used again."""
    out = np.empty(DENSE, np.int64)
    fill = DENSE / measure(lambda: out.fill(7)) / MEGA
    fresh = DENSE / measure(lambda: np.full(DENSE, 7)) / MEGA
    exact = exact_rate()
    laws = {
        "ramp up, 0 to 100 k steps/s": Accelerating(0, 0, Fraction(10**10, DENSE), 0, DENSE),
        "ramp down, 23 k to 100 steps/s": Accelerating(to_fixed(10**15), 100, 54, 0, DENSE, up=False),
        "ramp up, slow: 10 to 330 steps/s": Accelerating(0, 10, Fraction(1, 100), 0, DENSE),
    }
    made = [
        Row("int64 fill", fill, "M/s", "np.full fresh", fresh, None),
        Row("exact integer root per step, plain Python", exact, "M steps/s", "int64 fill", fill, None),
    ]
    paths: list[arrays.Path] = ["numpy"] if find_spec("numba") is None else ["numpy", "numba"]
    for path in paths:
        arrays.use(path)
        for name, law in laws.items():
            rate = DENSE / measure(partial(Train((law,)).times, out=out)) / MEGA
            target = None if "slow" in name else fill * (0.2 if path == "numpy" else 0.6)
            made.append(Row(f"{name}, {path}", rate, "M steps/s", "int64 fill", fill, target))
    arrays.use("numpy")
    periods = {"10 000 steps/s": (100_000, 1), "9 999 steps/s": (SECOND, 9999), "333 333 steps/s": (SECOND, 333_333)}
    for name, (numerator, denominator) in periods.items():
        train = Train((Uniform(0, numerator, denominator, DENSE),))
        rate = DENSE / measure(partial(train.times, out=out)) / MEGA
        made.append(Row(f"constant speed, {name}, numpy", rate, "M steps/s", "int64 fill", fill, 600.0))
    table = Train((Table.of(0, 8036, np.full(DENSE // 100, 100), np.arange(1000, 1000 + DENSE // 100)),))
    rate = DENSE / measure(lambda: table.times(out=out)) / MEGA
    made.append(Row("table, 100 pulses a row, numpy", rate, "M steps/s", "int64 fill", fill, None))
    ticked = Train((Ticked(0, 16_000, 2 * DENSE + 10, 62500**2, 0, 0, 62500**2 // (2 * DENSE + 10)),))
    part = out[: min(1_000_000, ticked.steps or 0)]
    rate = len(part) / measure(lambda: ticked.times(1, len(part), part)) / MEGA
    made.append(Row("ticked, numpy", rate, "M steps/s", "int64 fill", fill, None))
    arrays.use("auto")
    return made


def exact_rate() -> float:
    """M steps/s of the plainest exact code: one integer root a step, in whole ns."""
    n = 100_000
    return n / measure(lambda: [isqrt(10**15 * x) for x in range(n)]) / MEGA


def move_rows() -> list[Row]:
    """Moves as the GS-C200 makes them."""
    exact = exact_rate()
    plan = move.__wrapped__
    made = []
    for ramp, steps in ((50, 400), (999, 5000)):
        out = np.empty(steps, np.int64)
        train = plan(100, 10_000, ramp, steps).train
        trains = [train.at(to_fixed(10**9 + i)) for i in range(100)]
        again = 100 * steps / measure(partial(times_of_all, trains, out)) / MEGA
        fresh = 20 * steps / measure(partial(plan_and_fill, ramp, steps, 20)) / MEGA
        first = first_rate(ramp, steps)
        name = f"GS-C200 move, R {ramp}, {steps} steps"
        made.append(Row(f"{name}, first time", first, "M steps/s", "exact root per step", exact, 50.0))
        made.append(Row(f"{name}, planned and first time", fresh, "M steps/s", "exact root per step", exact, None))
        made.append(Row(f"{name}, again elsewhere", again, "M steps/s", "exact root per step", exact, 150.0))
    start = to_fixed(10**15)
    at = measure(lambda: [train.at(start) for _ in range(10_000)]) / 10_000 * 1e9
    planned = measure(lambda: [plan(100, 10_000, 999, n) for n in range(5000, 5500)]) / 500 * 1e9
    made.append(Row("Train.at", at, "ns", "one exact root, ns", 1e3 / exact, 1000.0))
    made.append(Row("move planned, not kept", planned, "ns", "one exact root, ns", 1e3 / exact, None))
    return made


def times_of_all(trains: list[Train], out: npt.NDArray[np.int64]) -> None:
    for train in trains:
        train.times(out=out)


def plan_and_fill(ramp: int, steps: int, repeat: int) -> None:
    for _ in range(repeat):
        move.__wrapped__(100, 10_000, ramp, steps).train.times()


def first_rate(ramp: int, steps: int) -> float:
    """M steps/s of the times of moves that are planned already, each of another length and asked once."""
    taken = []
    for _ in range(9):
        trains = [move.__wrapped__(100, 10_000, ramp, n).train for n in range(steps - 50, steps + 50)]
        begin = process_time()
        for train in trains:
            train.times()
        taken.append(process_time() - begin)
    return 100 * steps / min(taken) / MEGA


def query_rows() -> list[Row]:
    """Random questions to trains of 10**2, 10**4 and 10**6 segments of the ramps and slews of moves."""
    made = []
    for count in (100, 10_000, 1_000_000):
        train = many_segments(count)
        steps, end = train.steps or 0, train.duration or 0
        rng = np.random.default_rng(count)
        n, t = rng.integers(1, steps + 1, 1_000_000), rng.integers(0, end, 1_000_000)
        some_n, some_t = n[:20_000].tolist(), t[:20_000].tolist()
        ends = np.linspace(0, end, count).astype(np.int64).tolist()
        bisection = 20_000 / least(partial(ask_each, partial(bisect_right, ends), some_t)) / MEGA
        rates = {
            "time_of": 20_000 / least(partial(ask_each, train.time_of, some_n)),
            "steps_by": 20_000 / least(partial(ask_each, train.steps_by, some_t)),
            "state_at": 20_000 / least(partial(ask_each, train.state_at, some_t)),
            "times_of": 1_000_000 / least(partial(train.times_of, n)),
            "counts_by": 1_000_000 / least(partial(train.counts_by, t)),
        }
        targets = {"times_of": 5.0, "counts_by": 5.0}
        if count == 100:
            targets |= {"time_of": 1.0, "steps_by": 1.0, "state_at": 1.0}
        for method, rate in rates.items():
            name = f"{method}, {count} segments ({steps:.1e} steps)"
            made.append(Row(name, rate / MEGA, "M/s", "bisect of a list", bisection, targets.get(method)))
    return made


def ask_each(ask: Callable[[int], object], about: list[int]) -> None:
    for each in about:
        ask(each)


def many_segments(count: int) -> Train:
    """Moves one after another, in trains of three segments: up, slew, down."""
    one = move(100, 10_000, 100, 700)
    length = one.train.fixed_time(700)
    made = [s.moved(i * length) for i in range(count // 3 + 1) for s in one.train.segments]
    return Train(made[:count])


if __name__ == "__main__":
    print_table(rows())
