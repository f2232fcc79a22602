"""A call of a driver that is broken off between any two of its steps, or within one."""

from typing import Any

from detent.cell.host import HostPort
from detent.hosts.errors import DriverError
from detent.hosts.exchange import Ask, Steps


def broken_off(unit: Any, port: HostPort, steps: Steps[Any], behind: int, *, said: bool) -> bool:
    """Carry out so many steps, hand the next one over if it is to be `said`, and break off; whether all were done."""
    answer = None
    try:
        for _ in range(behind):
            answer = unit._do(next(steps) if answer is None else steps.send(answer))
        step = next(steps) if answer is None else steps.send(answer)
    except (StopIteration, DriverError):
        return True
    if said and isinstance(step, Ask):
        port.write(step.data)
    steps.close()
    return False
