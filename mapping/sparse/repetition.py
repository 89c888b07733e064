"""Texture that repeats, as of tiles and wallpaper: how much of it images show, and what it does to a map.

A feature that looks like others of its own image is matched with any copy of itself, so that images are placed where
another copy is, or nowhere.
"""

import contextlib
import logging
from collections.abc import Generator

import numpy as np

from flight import MapError
from mapping.sparse import features
from mapping.sparse.features import Features

logger = logging.getLogger(__name__)

MOST = 0.25
"""`share` of a quarter of the images beyond which matches are likely to be between different copies."""
_ALIKE, _APART_PX = 0.93, 8.0
"""Cosine of the descriptors, and distance, of two features that count as copies."""


def share(found: Features) -> float:
    """Share of an image's features that look like another one of the same image.

    Measured, medians over the images: .02 a rendered room, .05 a street, .06 an office; .35 to .75 a tiled room.
    """
    if not len(found.pixels):
        return 0.0
    descriptors = features.unit(found.descriptors)
    alike = descriptors @ descriptors.T > _ALIKE
    x, y = found.pixels.T
    apart = np.hypot(x[:, None] - x, y[:, None] - y) > _APART_PX
    return float((alike & apart).any(axis=1).mean())


@contextlib.contextmanager
def explained(repeated: float) -> Generator[None]:
    """State in plain words that COLMAP found no map, and that repeated texture may be the cause.

    Raises:
        MapError: also instead of COLMAP's own errors, which name its numbers of rigs and images.
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
        raise MapError(f"{error}{cause}") from error
    except (RuntimeError, IndexError, ValueError) as error:  # COLMAP's exceptions, as pybind11 translates them
        logger.info("COLMAP: %s", error)
        raise MapError(
            "no map: COLMAP found no positions of the images that fit each other; check that the camera file is that "
            f"of these images, and that they overlap{cause}"
        ) from error
