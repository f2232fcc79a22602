"""Units that are served in this process, for tests of what connects to them."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from detent.cell.description import Description, single
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.service import Service
from detent.ticks import SECOND


def no_file(name: str) -> str:
    raise FileNotFoundError(name)


@contextmanager
def served(
    what: str | Description,
    *,
    straps: Mapping[str, str] | None = None,
    options: Mapping[str, str] | None = None,
    endpoints: Sequence[EndpointSpec] = (),
    line_timing: bool = False,
    pace: float = 1.0,
) -> Iterator[Service]:
    """A model, or a cell, that has been on for a second, served by a thread. Characters take no time unless told."""
    if isinstance(what, str):
        what = single(what, straps=dict(straps or {}), options=dict(options or {}))
    with Service(what, no_file, endpoints, line_timing=line_timing, pace=pace) as service:
        service.cell.run_to(SECOND)
        with service.in_thread():
            yield service


def address(service: Service) -> str:
    """Where its first line is connected to."""
    return service.endpoints[0].address
