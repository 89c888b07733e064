"""Texture that repeats, as of tiles and wallpaper: how much of it images show, and what it does to a map.

A feature that looks like others of its own image is matched with any copy of itself, so that images are placed where
another copy is, or nowhere.
"""

import contextlib
import logging
from collections.abc import Generator

import numpy as np

from flight import MapError
from mapping.sparse.features import features
from mapping.sparse.features.features import Features

logger = logging.getLogger(__name__)

MOST = 0.25
"""`share` of a quarter of the images beyond which matches are likely to be between different copies."""
_ALIKE, _APART_PX = 0.93, 8.0
"""Cosine of the descriptors, and distance, of two features that count as copies."""
_AT_ONCE = 512
"""Features that are compared with all others at once: 20 MB for 8,000, 80 MB if all are alike."""
_DISK = ("disk is full", "no space left", "disk i/o error", "disk quota", "file too large")
"""What SQLite and the system say where a file cannot be written."""


def share(found: Features) -> float:
    """Share of an image's features that look like another one of the same image.

    Measured, medians over the images: .02 a rendered room, .05 a street, .06 an office; .35 to .75 a tiled room.
    """
    if not len(found.pixels):
        return 0.0
    descriptors = features.unit(found.descriptors)
    x, y = found.pixels.T
    copied = np.zeros(len(x), bool)
    for first in range(0, len(x), _AT_ONCE):
        later = descriptors[first:]  # with those before it, each was compared already
        one, other = first + np.array(np.nonzero(later[:_AT_ONCE] @ later.T > _ALIKE))
        apart = np.hypot(x[one] - x[other], y[one] - y[other]) > _APART_PX
        copied[one[apart]] = copied[other[apart]] = True
    return float(copied.mean())


@contextlib.contextmanager
def explained(repeated: float) -> Generator[None]:
    """State in plain words that COLMAP found no map, and that repeated texture may be the cause.

    Raises:
        MapError: also instead of COLMAP's own errors, which name its numbers of rigs and images. An error of the disk
            is told as one.
    """
    cause = (
        f"; {repeated:.0%} of the features look like others of the same image (repeated texture, as of tiles or "
        "wallpaper): fly where there is other texture"
        if repeated > MOST
        else ""
    )
    try:
        yield
    except MapError as error:
        raise _of_the_disk(error) or MapError(f"{error}{cause}") from error
    except (RuntimeError, IndexError, ValueError) as error:  # COLMAP's exceptions, as pybind11 translates them
        logger.info("COLMAP: %s", error)
        if (of_the_disk := _of_the_disk(error)) is not None:
            raise of_the_disk from error
        raise MapError(
            "no map: COLMAP found no positions of the images that fit each other; check that the camera file is that "
            f"of these images, and that they overlap{cause}"
        ) from error


def _of_the_disk(error: Exception) -> MapError | None:
    """What to say of an error that is no fault of the images."""
    said = str(error).splitlines()[0] if str(error) else ""
    if not any(words in str(error).lower() for words in _DISK):
        return None
    return MapError(f"a file of the map could not be written ({said}): make room; the same command goes on")
