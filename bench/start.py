"""How long verbs take to start and end, each against the bare interpreter: processor time of whole processes.

Processor time, and every verb in turn with the interpreter, so that what else the machine does matters little.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from statistics import median

from bench.rows import Row, print_table

TURNS = 15
DETENT = str(Path(sys.executable).with_name("detent"))
MOVE = "--supply 24 --step half --move 1000 --start 400 --slew 4000 --ramp 300"


def rows() -> list[Row]:
    served = subprocess.Popen([DETENT, "serve", "gs-c200", "--tcp", "127.0.0.1:0", "--json"], stdout=subprocess.PIPE)
    assert served.stdout is not None

    try:
        address = str(json.loads(served.stdout.readline())["endpoints"][0]["address"]).removeprefix("tcp:")
        return _rows(address)
    finally:
        served.terminate()
        served.wait()


def _rows(address: str) -> list[Row]:
    verbs = {
        "detent --help": (["--help"], 12),
        "detent run gs-c200 --send F": (["run", "gs-c200", "--send", "F"], 25),
        "detent send gs-c200 PORT F": (["send", "gs-c200", address, "F"], 25),
        "detent models": (["models"], 25),
        "detent motor NAME --move, caches warm": (["motor", "qsh4218-41-10-035", *MOVE.split()], 60),
    }
    bare: list[float] = []
    times: dict[str, list[float]] = {name: [] for name in verbs}
    for turn in range(TURNS + 1):
        bare.append(_seconds([sys.executable, "-c", "pass"]))
        for name, (words, _) in verbs.items():
            times[name].append(_seconds([DETENT, *words]))
        if turn == 0:  # warms caches
            bare.clear()
            for taken in times.values():
                taken.clear()
    base = median(bare) * 1e3
    return [
        Row(name, median(times[name]) * 1e3, "ms", "bare interpreter", base, most * base)
        for name, (_, most) in verbs.items()
    ]


def _seconds(words: list[str]) -> float:
    """Processor time of a process, its children's included."""
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, words
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    print_table(rows())
