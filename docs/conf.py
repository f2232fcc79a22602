"""How the pages become a site: `make docs` writes it to `docs/_build/html`, and takes every warning for an error."""

import detent

project = "Detent"
author = "The Detent authors"
copyright = "2026, The Detent authors"
version = release = detent.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode"]
exclude_patterns = ["_build"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
nitpicky = False
smartquotes = False  # an option has two hyphens, and its quotes are typed
suppress_warnings = ["myst.strikethrough"]

myst_heading_anchors = 4
myst_enable_extensions = ["deflist", "fieldlist", "html_image"]
myst_fence_as_directive = []

default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_default_options = {"members": True, "show-inheritance": True}

html_theme = "furo"
html_title = f"Detent {version}"
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {"navigation_with_keys": True, "footer_icons": []}
