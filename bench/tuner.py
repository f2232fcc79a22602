"""The tuner: CPU seconds of a whole search and of a map, on one core; the time that was found."""

from time import process_time

import numpy as np

from bench.rows import Row
from detent.motors.curve import greatest
from detent.motors.drive import Drive
from detent.motors.fit import fitted
from detent.motors.load import Load
from detent.motors.rotor import Rig
from detent.tuner.judge import judge_of
from detent.tuner.map import loss_map
from detent.tuner.task import Task, moves_of
from detent.tuner.tune import check_of, tune

FRESH = 16_384


def task(moves: str) -> Task:
    """The reference: a NEMA 17 motor fitted to its curve, 24 V, 2.8 times the rotor's inertia added."""
    fit = fitted("qsh4218-41-10-035")
    assert fit is not None
    return Task("gs-c200", Rig(fit.motor, Drive(24, 1.0), Load(inertia=1.5e-5, friction=0.02)), moves_of(moves))


def rows() -> list[Row]:
    """CPU seconds, over all threads."""
    tune(Task("gs-c200", task("50").rig, moves_of("50"), screened=32, final=32))  # what is compiled is compiled
    greatest.cache_clear()  # the curve of its motor, which the next search has to find too
    made = task("200,1000,5000")
    begin = process_time()
    found = tune(made)
    searched = process_time() - begin
    check = check_of(judge_of(made), found.found.point, FRESH, 10**6)
    one = task("1000")
    point = judge_of(one).space.hand
    begin = process_time()
    drawn = loss_map(one, point)
    mapped = process_time() - begin
    lossless = float(np.nanmean(drawn.lost == 0))
    return [
        Row("moves of 200, 1000 and 5000, found", found.found.time, "s", "by hand, made safe, s",
            found.safe_hand.time if found.safe_hand else 0.0, 1.21),
        Row(f"lost of {FRESH} fresh and 128 corners", check.lost + check.corners_lost, "", "allowed", 0.0, 0.0),
        Row("search and comparison, CPU", searched, "s", "allowed, s", 30.0, 30.0),
        Row(f"map of {drawn.lost.size} points by 32 variants, CPU", mapped, "s", "allowed, s", 15.0, 15.0),
        Row("part of that map without loss", lossless, "", "", 0.0, None),
    ]  # fmt: skip
