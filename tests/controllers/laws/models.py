"""The models that the laws are held against. A new controller joins by its adapter here."""

from collections.abc import Mapping

import pytest
from tests.controllers.laws import dcb274, genstepper, gsc200, supersigma
from tests.controllers.laws.adapter import Model

MODELS: tuple[Model, ...] = (*gsc200.MODELS, *supersigma.MODELS, *dcb274.MODELS, *genstepper.MODELS)

OPEN: Mapping[str, tuple[str, ...]] = {}
"""Models that do not keep a law yet: their faults are being mended."""


def every_model(law: str) -> pytest.MarkDecorator:
    """The tests of a law are held against every model."""
    models = [model for model in MODELS if model.name not in OPEN.get(law, ())]
    return pytest.mark.parametrize("model", models, ids=[model.name for model in models])
