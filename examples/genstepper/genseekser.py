"""GENSEEKSER (manual, pages 53 to 55): relative moves at 1/64 step, each motor at its own rates.

Y alone exceeds the rate of 6000 at which the board switches to full steps. `python genseekser.py` runs beside an
emulated board, `python genseekser.py PORT` with one on a serial port. The Stamp's program goes on for ever, this one
for four cycles, one for each step mode.
"""

import sys

from gendemoser import wait_ready
from stamp import Stamp, stamp, tell


def genseekser(one: Stamp, cycles: int = 4) -> None:
    """The program."""
    one.pause(250)  # power-on of the board
    one.serout("1!")  # reset, 1/64 of a full step
    one.pause(1000)  # the sign-on
    one.serout("2V")  # short answers, but later
    one.serout("320K")
    one.serout("6000A")  # only Y will exceed it
    one.serout("X")
    one.serout("4000p")
    one.serout("4000R")
    one.serout("Y")
    one.serout("7000p")
    one.serout("8000R")
    one.serout("B")
    mode = 0
    for _ in range(cycles):
        one.serout(f"{mode}o")
        one.serout("16000s")
        wait_ready(one)
        one.serout("-16000s")
        mode = (mode + 1) & 3
        wait_ready(one)
        one.pause(200)


if __name__ == "__main__":
    host = stamp(sys.argv[1:])
    genseekser(host)
    tell(host)
