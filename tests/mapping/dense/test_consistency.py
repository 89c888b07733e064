"""A rectified pair: a match that the pixel itself contradicts proves nothing, nor does one in a plain region."""

import cv2
import numpy as np
import pytest

from mapping import _mapping
from mapping.dense import consistency

ROWS, COLUMNS, SEARCHED, SHIFT = 60, 160, 48, 8
NOISE = 1.5


def pair(seed: int, *, stripe: int = 0, plain: int = 0, gain: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Two images of a textured wall at a disparity of SHIFT columns.

    Args:
        stripe: width in columns of an upright bar at 3 times that disparity, from column 90 of the left image on.
        plain: width of a patch without texture on the wall, from column 60 of the left image on.
        gain: brightness of the right image over that of the left.
    """
    rng = np.random.default_rng(seed)
    left = np.asarray(cv2.GaussianBlur(rng.normal(size=(ROWS, COLUMNS)), (0, 0), 1.5))
    left = 120.0 + 30.0 * left / left.std()
    right = np.roll(left, -SHIFT, axis=1)
    left[:, 60 : 60 + plain] = 120.0
    right[:, 60 - SHIFT : 60 - SHIFT + plain] = 120.0
    bar = rng.uniform(0.0, 30.0, (ROWS, stripe))
    left[:, 90 : 90 + stripe] = bar
    right[:, 90 - 3 * SHIFT : 90 - 3 * SHIFT + stripe] = bar
    noisy = (image + NOISE * rng.normal(size=image.shape) for image in (left, gain * right))
    left, right = (np.clip(np.round(image), 1, 255).astype(np.uint8) for image in noisy)
    return left, right


def claim(columns: float = SHIFT) -> np.ndarray:
    return np.full((ROWS, COLUMNS), round(16 * columns), np.int16)


INNER = (slice(5, -5), slice(SEARCHED + 5, -SEARCHED))


@pytest.mark.parametrize("gain", [1.0, 0.85, 1.15])
def test_a_textured_wall_is_neither_contradicted_nor_nearer_than_matched(gain: float) -> None:
    left, right = pair(1, gain=gain)
    nearest = consistency.nearest_disparity(left, right, claim(), SEARCHED)[INNER]
    assert (nearest >= 0).mean() > 0.99
    assert (nearest[nearest >= 0] <= 16 * (SHIFT + 1)).mean() > 0.99


@pytest.mark.parametrize("columns", [1, 2, 4])
def test_pixels_of_a_thin_bar_contradict_the_depth_of_the_wall_behind_it(columns: int) -> None:
    left, right = pair(2, stripe=columns)
    nearest = consistency.nearest_disparity(left, right, claim(), SEARCHED)
    assert (nearest[5:-5, 90 : 90 + columns] < 0).mean() > 0.75
    beside = np.delete(nearest[INNER], np.arange(90 - 3 * SHIFT - 10, 90 + 20) - SEARCHED - 5, axis=1)
    assert (beside >= 0).mean() > 0.99


def test_in_a_plain_patch_every_depth_up_to_its_edge_is_possible() -> None:
    width = 40
    left, right = pair(3, plain=width)
    nearest = consistency.nearest_disparity(left, right, claim(), SEARCHED)
    columns = np.arange(64, 60 + width - 4)
    reach = np.median(nearest[20:40, columns] / 16.0 - SHIFT, axis=0)
    to_edge = columns - 60  # a nearer depth looks alike until its block leaves the patch
    assert (reach >= np.minimum(to_edge - 4, SEARCHED - 1 - SHIFT)).all()
    assert (reach <= to_edge + 4).all()


def test_nothing_is_known_where_the_matcher_found_nothing_and_never_less_than_it_found() -> None:
    left, right = pair(4)
    rng = np.random.default_rng(4)
    claimed = np.where(rng.random((ROWS, COLUMNS)) < 0.3, -16, rng.integers(0, 16 * SEARCHED, (ROWS, COLUMNS)))
    nearest = consistency.nearest_disparity(left, right, claimed.astype(np.int16), SEARCHED)
    assert (nearest[claimed < 0] < 0).all()
    assert ((nearest < 0) | (nearest >= claimed)).all()
    assert (consistency.nearest_disparity(left, right, np.full_like(claim(), -16), SEARCHED) < 0).all()


def test_the_kernel_computes_what_its_plain_form_does() -> None:
    rng = np.random.default_rng(5)
    rows, columns, searched, noise, deviations, mean = 12, 40, 14, 6.0, 4.0, 1.3
    left = rng.integers(1, 90, (rows, columns)).astype(np.uint8)
    right = np.where(rng.random((rows, columns)) < 0.7, np.roll(left, -3, axis=1), 60).astype(np.uint8)
    claimed = rng.choice(np.array([-16, 40, 48, 55, 160], np.int16), (rows, columns))
    found = _mapping.nearest_disparity(left, right, claimed, searched, noise, deviations, mean)
    expected = np.full_like(claimed, -16)
    here, there = left.astype(int), right.astype(int)
    for r in range(1, rows - 1):
        for c in range(1, columns - 1):
            at = c - claimed[r, c] / 16.0
            if claimed[r, c] < 0 or at < 0.0 or at + 1 >= columns:
                continue
            around = here[[r - 1, r + 1, r, r], [c, c, c - 1, c + 1]]
            allowed = deviations * noise + 0.5 * np.abs(around - here[r, c]).max()
            if abs(here[r, c] - np.interp(at, np.arange(columns), there[r])) > allowed:
                continue
            last = int(claimed[r, c])
            for d in range(last // 16 + 1, searched):
                a, b = np.meshgrid(
                    np.arange(max(r - 2, 0), min(r + 3, rows)), np.arange(max(c - 2, d), min(c + 3, columns))
                )
                if np.abs(here[a, b] - there[a, b - d]).sum() > int(25 * mean * noise):
                    break
                last = 16 * d
            expected[r, c] = last
    np.testing.assert_array_equal(found, expected)
