"""A light and a dark picture in one line of a page, read by GitHub and by Sphinx.

GitHub shows `<picture>`; Furo shows images of the classes `only-light` and `only-dark`, which Sphinx checks and copies.
"""

import re

PICTURE = re.compile(
    r'<picture><source media="\(prefers-color-scheme: dark\)" srcset="([^"]+)">'
    r'<img alt="([^"]+)" src="([^"]+)"></picture>'
)
"""Dark file, description, light file."""
_IMAGE = ":::{{image}} {}\n:alt: {}\n:class: only-{}\n:::\n"


def targets(text: str) -> list[str]:
    """Files of a page's pictures."""
    return [name for dark, _, light in PICTURE.findall(text) for name in (dark, light)]


def for_sphinx(text: str) -> str:
    """The page with each `<picture>` as the theme's two images."""
    return PICTURE.sub(lambda m: _IMAGE.format(m[3], m[2], "light") + "\n" + _IMAGE.format(m[1], m[2], "dark"), text)
