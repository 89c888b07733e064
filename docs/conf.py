"""Sphinx settings: MyST pages, API from docstrings."""

import importlib.metadata
import sys
from pathlib import Path

from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).parents[1]))
from tools.reference import docstrings, expand
from tools.two_styles import for_sphinx

project = "Goshawk"
author = "The Goshawk authors"
release = importlib.metadata.version("goshawk")
extensions = ["myst_parser", "sphinx.ext.autodoc"]
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "Goshawk"
autoclass_content = "both"
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_default_options = {
    "members": True,
    "undoc-members": True,
    "inherited-members": "object, BaseException, Exception, Enum, Flag, int, str, tuple, dict, Generic, Protocol",
}
default_role = "code"
suppress_warnings = ["ref.python"]


def setup(app: Sphinx) -> None:
    """Fill in what is generated, and read docstrings as they are written."""
    app.connect("source-read", lambda app, name, source: source.__setitem__(0, for_sphinx(expand(source[0]))))
    app.connect("autodoc-process-docstring", docstrings.prepare)
    app.connect("autodoc-process-signature", docstrings.shorten)
