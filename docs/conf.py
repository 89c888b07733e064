"""Sphinx settings: MyST pages, API from docstrings."""

import importlib.metadata

project = "Goshawk"
author = "The Goshawk authors"
release = importlib.metadata.version("goshawk")
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "Goshawk"
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
suppress_warnings = ["ref.python"]
