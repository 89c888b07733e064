"""Where the images and masks of a map were when it was made: in its `map.toml`, relative to the map folder.

So a project that is moved as a whole still finds them.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flight import FormatError

IMAGES, MASKS = "images_from", "masks_from"
"""Keys of `map.toml`: a folder of images or a video; a folder of masks."""


def noted(out: Path, images: Path, masks: Path | None) -> dict[str, str]:
    """The entries of `map.toml` for a map in `out`."""
    given = {IMAGES: images, MASKS: masks}
    return {key: os.path.relpath(path.resolve(), out.resolve()) for key, path in given.items() if path is not None}


def read(folder: Path, facts: Mapping[str, Any], key: str) -> Path | None:
    """Where one of them was; None where `map.toml` does not say: in copies, and in maps of earlier versions.

    Args:
        folder: the map's.
        facts: of its `map.toml`.
        key: `IMAGES` or `MASKS`.

    Raises:
        FormatError: the entry is not a path.
    """
    given = facts.get(key)
    if given is None:
        return None
    if not isinstance(given, str) or not given or "\0" in given:
        raise FormatError(f"{folder / 'map.toml'}: {key} is {given!r}; a path relative to the map is expected")
    return Path(os.path.normpath(folder.resolve() / given))
