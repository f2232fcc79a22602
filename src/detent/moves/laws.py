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


def law(model: str, options: Mapping[str, object] | None = None, axis: str = "") -> Law:
    """How an axis of `model`, with these options (as a cell file writes them), makes moves. Raises CatalogueError."""
    found = catalogue.model(model)
    return _MAKE[found.name](found, catalogue.option_values(found, options or {}), axis)
