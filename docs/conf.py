"""How the pages become a site: `make docs` writes it to `docs/_build/html`, and takes every warning for an error."""

from functools import update_wrapper
from inspect import Parameter
from typing import Any

from sphinx.application import Sphinx
from sphinx.util.inspect import safe_getattr

import detent
from detent.hosts.exchange import Operation

project = "Detent"
author = "The Detent authors"
copyright = "2026, The Detent authors"
version = release = detent.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode"]
exclude_patterns = ["_build"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
nitpicky = False
suppress_warnings = ["myst.strikethrough"]

myst_heading_anchors = 4
myst_enable_extensions = ["deflist", "fieldlist"]
myst_fence_as_directive = []

default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_default_options = {"members": True, "show-inheritance": True}


def setup(app: Sphinx) -> None:
    """The methods of drivers are shown as the calls that they are."""
    app.add_autodoc_attrgetter(type, _member)


def _member(owner: type, name: str, *default: Any) -> Any:
    found = safe_getattr(owner, name, *default)
    if not isinstance(found, Operation):
        return found

    def call() -> None:
        """Stands for it."""

    update_wrapper(call, found)
    del call.__wrapped__
    own = Parameter("self", Parameter.POSITIONAL_OR_KEYWORD)
    signature = found.signature
    call.__signature__ = signature.replace(parameters=[own, *signature.parameters.values()])
    return call


html_theme = "furo"
html_title = f"Detent {version}"
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {"navigation_with_keys": True, "footer_icons": []}
