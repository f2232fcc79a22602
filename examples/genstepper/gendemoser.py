"""GENDEMOSER (manual, pages 51 and 52): both motors between 0 and 2000, in every step mode, by the serial line.

`python gendemoser.py` runs beside an emulated board, `python gendemoser.py PORT` with one on a serial port. The
Stamp's program goes on for ever, this one for four cycles, one for each step mode.
"""

import sys

from stamp import Stamp, stamp, tell


def gendemoser(one: Stamp, cycles: int = 4) -> None:
    """The program."""
    one.pause(250)  # power-on of the board
    one.serout("4!")  # reset, 4/64 of a full step
    one.pause(1000)  # the sign-on
    one.serout("2V")  # short answers, but later
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
    """The zeros flush the board's output; the prompt then is that of I."""
    one.serout("00I")
    one.serin_wait("*")


if __name__ == "__main__":
    host = stamp(sys.argv[1:])
    gendemoser(host)
    tell(host)
