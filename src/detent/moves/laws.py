"""The law of a model of the catalogue."""

from collections.abc import Mapping

from detent.controllers import catalogue
from detent.moves import dcb274, genstepper, gsc200, supersigma
from detent.moves.law import Law

_MAKE = {
    "gs-c200": gsc200.law,
    "gs-c200s": gsc200.law,
    "dcb-274": dcb274.law,
    "supersigma": supersigma.law,
    "bs0610": genstepper.law,
    "bs0710": genstepper.law,
}

_AXES = {"bs0610": ("X", "Y"), "bs0710": ("X", "Y")}  # of models with more than one


def law(model: str, options: Mapping[str, object] | None = None, axis: str = "") -> Law:
    """How an axis of `model`, with these options (as a cell file writes them), makes moves. Raises CatalogueError."""
    found = catalogue.model(model)
    axes = _AXES.get(found.name, ())
    if axis and axis not in axes:
        raise (catalogue.unknown(f"motor of a {found.name}", axis, axes) if axes
               else catalogue.CatalogueError(f"a {found.name} has one axis: leave {axis!r} out"))  # fmt: skip
    return _MAKE[found.name](found, catalogue.option_values(found, options or {}), axis)
