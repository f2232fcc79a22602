"""Services that are run in a thread for a test, with what controls them."""

from collections.abc import Iterator
from contextlib import contextmanager

from detent.cell.description import Description, parse, single
from detent.realtime.control import Control
from detent.realtime.service import Service

SLIDE = """
[units.slide]
model = "gs-c200"
straps = { CHS = "low" }
[units.other]
model = "gs-c200s"
straps = { CHS = "low" }
[units.watch]
model = "step-detector"
[[wires]]
from = "slide.UO1"
to = "other.UI1"
[switches.sensor]
drives = ["slide.UI1"]
axis = "slide"
from = 50
[switches.hand]
drives = "slide.UI2"
"""


def no_file(name: str) -> str:
    raise FileNotFoundError(name)


def one() -> Description:
    return single("gs-c200", straps={"CHS": "low"})


def slide() -> Description:
    return parse(SLIDE, "slide.toml")


def looping() -> Description:
    """A unit with a program that goes on for ever: something happens every few milliseconds."""
    return parse('[units.slide]\nmodel = "gs-c200s"\nprogram = "again.gsc"\nstraps = { CHS = "low" }\n', "again.toml")


def again(name: str) -> str:
    """The files of `looping`; of the other cells there is none."""
    if name != "again.gsc":
        raise FileNotFoundError(name)
    return "again: W1\nj again\n"


@contextmanager
def controlled(description: Description, *, free: bool = True) -> Iterator[Control]:
    """The control of a cell that is served, as fast as it goes unless it shall keep pace."""
    with Service(description, again, observed=True) as service:
        if free:
            service.pace.change(None, service.cell.now)
        with service.in_thread():
            yield Control(service)
