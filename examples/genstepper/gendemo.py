"""GENDEMO (manual, pages 49 and 50): both motors between 0 and 2000, in every step mode, by the RDY line.

Run it beside an emulated board with `python gendemo.py`; on a serial port, which has no RDY, gendemoser.py does the
same. The Stamp's program goes on for ever, this one for four cycles, one for each step mode.
"""

import sys

from stamp import Stamp, stamp, tell


def gendemo(one: Stamp, cycles: int = 4) -> None:
    """The program."""
    one.pause(250)  # power-on of the board
    one.serout("4!")  # reset, 4/64 of a full step
    one.pause(1000)  # the sign-on
    one.serout("80K")
    one.serout("1000p")
    one.serout("1000R")
    mode = 0
    for _ in range(cycles):
        one.serout(f"{mode}o")
        one.serout("2000g")
        wait_ready(one)
        one.serout("0g")
        mode = (mode + 1) & 3
        wait_ready(one)
        one.pause(200)


def wait_ready(one: Stamp) -> None:
    """Look at RDY, but not before the board had time to pull it low."""
    one.pause(100)
    while one.busy():
        one.pause(100)


if __name__ == "__main__":
    host = stamp(sys.argv[1:], watches_ready=True)
    gendemo(host)
    tell(host)
