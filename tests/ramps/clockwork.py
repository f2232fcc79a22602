"""The rate generator clock by clock, as the paper tells it: the slow witness of `detent.ramps.rate_generator`."""

from collections.abc import Sequence


def pulses(first: int, loads: Sequence[tuple[int, int]], until: int) -> list[int]:
    """The clocks of all pulses up to clock `until`. `loads` are (clock, N), in order."""
    found, running, left, register = [], first, first + 1, first
    waiting = list(loads)
    while waiting and waiting[0][0] == 0:  # on the clock of the start the period has begun already
        register = waiting.pop(0)[1]
    for clock in range(1, until + 1):
        left -= 1
        if left == 0:  # pulse first
            found.append(clock)
            running = register
            left = running + 1
        while waiting and waiting[0][0] == clock:
            register = waiting.pop(0)[1]
    return found


def movement(differences: Sequence[int], first: int, steps: int, interval: int = 2580, offset: int = 10) -> list[int]:
    """The clocks of the pulses of a movement with the whole table, by steps (a) to (g) of "Long movements"."""
    found: list[int] = []
    left, register, n, entry = first + 1, first, first, 0
    up, begin, clock = 0, 0, 0
    while len(found) < steps:
        clock += 1
        left -= 1
        if left == 0:
            found.append(clock)
            left = register + 1
        if entry < len(differences) and not begin and clock % interval == 0:  # (c) scan the table
            n -= differences[entry]
            entry += 1
            register = n
            if entry == len(differences):  # (d) read the counter
                up = len(found)
        if up and not begin and len(found) >= steps - up - offset:  # (e), (f)
            begin = clock
        if begin and entry and (clock - begin) % interval == 0:  # (g) add them back, the first at once
            entry -= 1
            n += differences[entry]
            register = n
    assert entry == 0, "the table had not ended"
    return found
