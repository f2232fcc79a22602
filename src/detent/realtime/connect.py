"""One call from a model's name and a port to a driver that is ready: `connect` and `connect_async`."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypedDict, Unpack, overload

from detent.hosts.exchange import AsyncPort, Driver, Port, Watch
from detent.uart import Format

if TYPE_CHECKING:
    from detent.hosts.dcb274 import AsyncDcb274, BlockingDcb274
    from detent.hosts.genstepper import AsyncGenStepper, BlockingGenStepper
    from detent.hosts.gsc200 import AsyncGsC200, BlockingGsC200
    from detent.hosts.supersigma import AsyncSupersigma, BlockingSupersigma


class Host(NamedTuple):
    """How a model is driven: where its driver is, the format of its line unless told, what the driver may be told."""

    module: str
    driver: str
    form: Format
    options: tuple[str, ...]
    takes_model: bool = False
    takes_baud: bool = False

    def make(self, model: str, baud: int, options: Mapping[str, object]) -> Driver:
        """The plain driver. Raises ValueError for an option that it does not have, or cannot be so."""
        for name in options:
            if name not in self.options:
                raise _unknown(f"option of the driver of the {model}", name, self.options)
        given: dict[str, Any] = {**options, **({"baud": baud} if self.takes_baud else {})}
        kind: Callable[..., Driver] = getattr(import_module(self.module), self.driver)
        return kind(model, **given) if self.takes_model else kind(**given)

    def shell(self, way: str) -> Any:
        """Its class with a shell, `way` Blocking or Async."""
        return getattr(import_module(self.module), f"{way}{self.driver}")


_GSC200 = Host(
    "detent.hosts.gsc200", "GsC200", Format(9600, 7, "odd", 2), ("address", "checksums", "revision", "patience"),
    takes_model=True, takes_baud=True,
)  # fmt: skip
_GENSTEPPER = Host("detent.hosts.genstepper", "GenStepper", Format(9600), ("motor", "patience"), takes_baud=True)

HOSTS: dict[str, Host] = {
    "gs-c200": _GSC200,
    "gs-c200s": _GSC200,
    "supersigma": Host("detent.hosts.supersigma", "Supersigma", Format(200_000), ("drive", "patience")),
    "dcb-274": Host("detent.hosts.dcb274", "Dcb274", Format(9600), ("name", "mode", "first", "patience")),
    "bs0610": _GENSTEPPER,
    "bs0710": _GENSTEPPER,
}


LINE: dict[str, tuple[int | str, ...]] = {
    "data_bits": (5, 6, 7, 8), "parity": ("none", "odd", "even"), "stop_bits": (1, 2),
}  # fmt: skip
"""What the format of a line may be."""


def host(model: str) -> Host:
    """How `model` is driven. Raises ValueError, with the likeliest of the models there are."""
    if not isinstance(model, str):
        raise ValueError(f"a model is a name, one of {', '.join(HOSTS)}, not {model!r}")
    try:
        return HOSTS[model]
    except KeyError:
        raise _unknown("model", model, tuple(HOSTS)) from None


class LineOptions(TypedDict, total=False):
    """The line, where it differs from the model's own; `watch` is told how far long operations are."""

    baud: int
    data_bits: int
    parity: str
    stop_bits: int
    watch: Watch | None
    patience: float


class GsC200Options(LineOptions, total=False):
    """What `detent.hosts.gsc200.GsC200` may be told."""

    address: int | None
    checksums: bool
    revision: str


class Dcb274Options(LineOptions, total=False):
    """What `detent.hosts.dcb274.Dcb274` may be told."""

    name: str
    mode: str
    first: str


class GenStepperOptions(LineOptions, total=False):
    """What `detent.hosts.genstepper.GenStepper` may be told."""

    motor: str


class SupersigmaOptions(LineOptions, total=False):
    """What `detent.hosts.supersigma.Supersigma` may be told."""

    drive: int


@overload
def connect(
    model: Literal["gs-c200", "gs-c200s"], port: str | Port, **options: Unpack[GsC200Options]
) -> "BlockingGsC200": ...
@overload
def connect(model: Literal["dcb-274"], port: str | Port, **options: Unpack[Dcb274Options]) -> "BlockingDcb274": ...
@overload
def connect(
    model: Literal["bs0610", "bs0710"], port: str | Port, **options: Unpack[GenStepperOptions]
) -> "BlockingGenStepper": ...
@overload
def connect(
    model: Literal["supersigma"], port: str | Port, **options: Unpack[SupersigmaOptions]
) -> "BlockingSupersigma": ...
@overload
def connect(model: str, port: str | Port, **options: Any) -> Any: ...
def connect(model: str, port: str | Port, **options: Any) -> Any:
    """The driver of `model` at `port`, with operations that are calls.

    `port` is a serial device, a link to one, ``HOST:PORT`` or ``rfc2217://HOST:PORT``, or the `port` of another
    driver, to share its line. The format is the model's unless `baud`, `data_bits`, `parity` or `stop_bits` say
    otherwise; other `options` are those of the driver, like `address` of a GS-C200. Nothing is sent yet. Raises
    ValueError, and PortError if the port cannot be opened.
    """
    from detent.realtime.ports import open_port

    found = host(model)
    _see_port(port)
    form, watch = _line(found, options)
    driver = found.make(model, form.baud, options)
    shell = found.shell("Blocking")
    return shell(driver, open_port(port, **form._asdict()) if isinstance(port, str) else port, watch)


@overload
async def connect_async(
    model: Literal["gs-c200", "gs-c200s"], port: str | AsyncPort, **options: Unpack[GsC200Options]
) -> "AsyncGsC200": ...
@overload
async def connect_async(
    model: Literal["dcb-274"], port: str | AsyncPort, **options: Unpack[Dcb274Options]
) -> "AsyncDcb274": ...
@overload
async def connect_async(
    model: Literal["bs0610", "bs0710"], port: str | AsyncPort, **options: Unpack[GenStepperOptions]
) -> "AsyncGenStepper": ...
@overload
async def connect_async(
    model: Literal["supersigma"], port: str | AsyncPort, **options: Unpack[SupersigmaOptions]
) -> "AsyncSupersigma": ...
@overload
async def connect_async(model: str, port: str | AsyncPort, **options: Any) -> Any: ...
async def connect_async(model: str, port: str | AsyncPort, **options: Any) -> Any:
    """As `connect`; the driver's operations are coroutines of the running loop."""
    from detent.realtime.async_ports import open_async_port

    found = host(model)
    _see_port(port)
    form, watch = _line(found, options)
    driver = found.make(model, form.baud, options)
    shell = found.shell("Async")
    return shell(driver, await open_async_port(port, **form._asdict()) if isinstance(port, str) else port, watch)


def _see_port(port: object) -> None:
    """Raise ValueError for what is no port, before it fails in the middle of a call."""
    if isinstance(port, str) or all(hasattr(port, name) for name in ("write", "receive", "keep", "turn")):
        return
    rate = f"; a rate is named, baud={port}" if isinstance(port, int) else ""
    raise ValueError(
        "a port is a serial device like /dev/ttyUSB0, HOST:PORT, rfc2217://HOST:PORT, or the port of another driver, "
        f"not {port!r}{rate}"
    )


def _line(found: Host, options: dict[str, Any]) -> tuple[Format, Watch | None]:
    """The format, taken out of the options, and who watches. Raises ValueError for what no line is, nor patience."""
    form = found.form._replace(**{name: options.pop(name) for name in Format._fields if name in options})
    if form.baud < 1:
        raise ValueError(f"baud {form.baud}: a line has bits a second, like {found.form.baud}")
    for name, kinds in LINE.items():
        if getattr(form, name) not in kinds:
            raise ValueError(f"{name} {getattr(form, name)!r}: choose from {', '.join(map(str, kinds))}")
    if not options.get("patience", 1.0) > 0:
        raise ValueError(f"patience {options['patience']:g}: a unit needs some time to answer, like 1 s")
    return form, options.pop("watch", None)


def _unknown(kind: str, name: str, known: tuple[str, ...]) -> ValueError:
    from detent.controllers.catalogue import unknown  # only here: it brings all controllers with it

    return unknown(kind, name, known)
