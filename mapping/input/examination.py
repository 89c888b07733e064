"""What can be said of images before any long work: blur, exposure, overlap, times, and folders that are exchanged."""

import itertools
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, Progress, rotations, silent
from mapping import workers
from mapping.camera.rig import Camera
from mapping.input import selection, stereo_order
from mapping.input.images import ImageSet
from mapping.input.stereo_order import Features

FEW_INSTANTS = 8
"""Fewer instants make a poor map, if any."""
_BLURRED = 0.35
"""Sharpness below this share of the neighbours' median."""
_NEIGHBOURS = 4
"""Images before and after that an image is compared with."""
_DARK, _BRIGHT, _CLIPPED = 20.0, 235.0, 0.4
"""Mean grey levels, and the share of pixels that are black or white."""
_LEAST_MATCHES = 15
"""An image that shares fewer features with both neighbours is likely to be left out."""
_LONG_STEP = 5.0
"""Over the median time step."""
_USUAL_STEP_S = 20.0
"""A longer one, in the median, is in another unit: 30 images a second in milliseconds are 33 apart."""
_MOST_SWAPPED = 4
"""Cameras of a rig whose folders are tried in every order."""
_TURN_RAD = np.radians(1.5)
"""Turns of one body that differ by less, from camera to camera, are the same. Many differ by more though the folders
are right: what a camera sees of a floor alone leaves its turn ambiguous."""
_LEAST_TELLING, _CLEARER = 3, 5.0
"""Instants whose turns fit another order of the folders and not the given one, at least, and how many times those that
fit the given one and not the other."""
_STAGE = "looking at the images"
_FEATURES, _RATIO = 600, 0.8
_LEAST_DEPTH = 0.3
"""Rays further from the optical axis have no place in a plane."""


@dataclass(frozen=True, slots=True)
class ImageFacts:
    """One image."""

    image: str
    """Its path below the image folder."""
    sharpness: float
    """Over the median of its neighbours'; 1 is usual."""
    mean_level: float
    """Mean grey level, 0 to 255."""
    clipped_share: float
    """Share of the pixels that are black or white."""
    matches_before: int | None
    """Features it shares with the image before of the same camera; None for the first."""
    step_s: float | None
    """Time since the instant before; None where not known."""
    problems: tuple[str, ...]
    """What is wrong with it."""


@dataclass(frozen=True, slots=True)
class Examination:
    """All images of a set."""

    images: tuple[ImageFacts, ...]
    """In the order of `ImageSet.pairs`."""
    problems: tuple[str, ...]
    """What is wrong with the set as a whole."""
    exchanged: tuple[str, ...] = ()
    """Folders whose images were taken by another camera than the camera file says."""

    def as_dict(self) -> dict[str, Any]:
        """For a report file."""
        return asdict(self)


@dataclass(slots=True, eq=False)
class _Seen:
    """What is kept of an image while its set is examined."""

    sharpness: float
    mean_level: float
    clipped_share: float
    rays: FloatArray
    descriptors: np.ndarray
    matches_before: int | None = None
    turn_rad: FloatArray = field(default_factory=lambda: np.full(3, np.nan))
    """Rotation vector since the image before, in the camera frame."""


def examine(images: ImageSet, *, progress: Progress = silent) -> Examination:
    """Look at every image once; some hundredths of a second each."""
    seen: dict[tuple[int, int], _Seen] = {}
    lit = [camera.lit() for camera in images.rig]

    def look(shot: tuple[int, int]) -> _Seen:
        instant, camera = shot
        used = images.used(instant, camera)
        usable = lit[camera] if used is None else lit[camera] & used
        return _look(images.gray(instant, camera), usable, images.rig.cameras[camera])

    fitting: dict[tuple[int, int], list[tuple[int, int]]] = {}
    asked = max(1, len(images.instants) // stereo_order.MOST_INSTANTS)
    looks = zip(images.pairs(), workers.in_order(look, images.pairs()), strict=True)
    for number, ((instant, camera), here) in enumerate(looks, start=1):
        seen[instant, camera] = here
        if (before := seen.get((instant - 1, camera))) is not None:
            here.matches_before, here.turn_rad = _compared(before, here, images.rig.cameras[camera])
            before.descriptors = before.descriptors[:0]  # the features of a few images are held at once
        for other in range(camera) if instant % asked == 0 else ():
            if (beside := seen.get((instant, other))) is not None:
                both = images.rig.cameras[other], images.rig.cameras[camera]
                if stereo_order.can_tell(both):
                    found = stereo_order.fitting(_features(beside), _features(here), both)
                    fitting.setdefault((other, camera), []).append(found)
        progress(_STAGE, number / images.count)
    facts = tuple(_facts(images, seen, shot) for shot in images.pairs())
    exchanged, why = (
        _exchanged(images, seen),
        "the turns that the images show fit the camera file only in another order",
    )
    if not exchanged:
        exchanged = _behind(images, fitting)
        why = "in the camera file's order, what both see would lie behind them, or they were not triggered together"
    return Examination(facts, (*_set_problems(images, facts), *_swap_problem(exchanged, why)), exchanged)


def _features(seen: _Seen) -> Features:
    return Features(seen.rays, seen.descriptors)


def _behind(images: ImageSet, fitting: dict[tuple[int, int], list[tuple[int, int]]]) -> tuple[str, ...]:
    """Folders of two cameras that look the same way and are exchanged."""
    for pair, found in fitting.items():
        if stereo_order.are_exchanged(np.array(found)):
            return tuple(images.rig.cameras[k].folder for k in pair)
    return ()


def _look(gray: np.ndarray, usable: np.ndarray, camera: Camera) -> _Seen:
    import cv2

    levels = gray[usable]
    orb = cv2.ORB.create(_FEATURES)
    corners, descriptors = orb.detectAndCompute(gray, usable.astype(np.uint8) * 255)
    pixels = np.array([c.pt for c in corners]).reshape(-1, 2) + 0.5
    if descriptors is None:
        descriptors = np.zeros((0, 32), np.uint8)
    return _Seen(
        selection.sharpness(gray),
        float(levels.mean()),
        float(((levels <= 3) | (levels >= 252)).mean()),
        camera.unproject(pixels),
        np.asarray(descriptors),
    )


def _compared(a: _Seen, b: _Seen, camera: Camera) -> tuple[int, FloatArray]:
    """How many features agree with one motion, and its rotation vector in the camera frame of `a`."""
    import cv2

    nothing = np.full(3, np.nan)
    if min(len(a.descriptors), len(b.descriptors)) < 2:
        return 0, nothing
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(a.descriptors, b.descriptors, k=2)
    good = [first for first, second in (p for p in pairs if len(p) == 2) if first.distance < _RATIO * second.distance]
    from_a, from_b = a.rays[[m.queryIdx for m in good]], b.rays[[m.trainIdx for m in good]]
    ahead = (from_a[:, 2] > _LEAST_DEPTH) & (from_b[:, 2] > _LEAST_DEPTH)
    flat_a, flat_b = (rays[ahead, :2] / rays[ahead, 2:] for rays in (from_a, from_b))
    if len(flat_a) < _LEAST_MATCHES:
        return len(flat_a), nothing
    threshold = 1.5 / min(camera.focal_px)
    cv2.setRNGSeed(1)
    essential, inliers = cv2.findEssentialMat(flat_a, flat_b, np.eye(3), cv2.RANSAC, 0.999, threshold)
    if essential is None or essential.shape != (3, 3):
        return 0, nothing
    count, R_b_a, _, _ = cv2.recoverPose(essential, flat_a, flat_b, np.eye(3), mask=inliers)
    turn = -rotations.log(rotations.from_matrix(np.asarray(R_b_a)))
    return int(inliers.sum()), turn if count >= _LEAST_MATCHES else nothing


def _facts(images: ImageSet, seen: dict[tuple[int, int], _Seen], shot: tuple[int, int]) -> ImageFacts:
    instant, camera = shot
    here = seen[shot]
    around = [seen.get((k, camera)) for k in range(instant - _NEIGHBOURS, instant + _NEIGHBOURS + 1) if k != instant]
    usual = float(np.median([other.sharpness for other in around if other] or [here.sharpness]))
    sharp = here.sharpness / max(usual, 1e-9)
    after = seen.get((instant + 1, camera))
    counts = [c for c in (here.matches_before, after.matches_before if after else None) if c is not None]
    step_s = float(images.time_s[instant] - images.time_s[instant - 1]) if instant else float("nan")
    problems: list[str] = []
    if sharp < _BLURRED:
        problems.append("blurred")
    if here.mean_level < _DARK:
        problems.append("too dark")
    elif here.mean_level > _BRIGHT:
        problems.append("too bright")
    elif here.clipped_share > _CLIPPED:
        problems.append("clipped")
    if counts and max(counts) < _LEAST_MATCHES:
        problems.append("little overlap")
    return ImageFacts(
        images.relative(*shot),
        round(sharp, 3),
        round(here.mean_level, 1),
        round(here.clipped_share, 4),
        here.matches_before,
        round(step_s, 6) if np.isfinite(step_s) else None,
        tuple(problems),
    )


def _set_problems(images: ImageSet, facts: Sequence[ImageFacts]) -> list[str]:
    problems = list(images.notes)
    if (count := len(images.instants)) < FEW_INSTANTS:
        problems.append(f"only {count} instants; a map wants at least {FEW_INSTANTS}")
    if len(images.rig) > 1 and not images.has_pairs:
        problems.append("no two cameras have an image of the same name, which means the same instant")
    for problem in ("blurred", "too dark", "too bright", "clipped", "little overlap"):
        if named := [f.image for f in facts if problem in f.problems]:
            problems.append(f"{len(named)} of {len(facts)} images {problem}: {_some(named)}")
    known = np.isfinite(images.time_s)
    if known.any() and not known.all():
        missing = [images.instants[k] for k in np.flatnonzero(~known)]
        problems.append(f"{len(missing)} of {len(known)} instants have no time in times.csv: {_some(missing)}")
    steps_s, named = np.diff(images.time_s[known]), [images.instants[k] for k in np.flatnonzero(known)[1:]]
    if backward := [n for n, step_s in zip(named, steps_s, strict=True) if step_s <= 0.0]:
        problems.append(
            f"the time of {_some(backward)} is not after that of the image before: names and times disagree"
        )
    elif len(steps_s) and (usual_s := float(np.median(steps_s))) > _USUAL_STEP_S:
        problems.append(
            f"the times of neighbouring images are {usual_s:.3g} s apart (median; up to {_USUAL_STEP_S:g} s is usual): "
            "times.csv is in seconds"
        )
    elif len(steps_s) > 2 and steps_s.max() > _LONG_STEP * (usual_s := float(np.median(steps_s))):
        problems.append(
            f"{steps_s.max():.2f} s without an image before {named[int(steps_s.argmax())]}; {usual_s:.2f} s is usual"
        )
    return problems


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:4]) + (" ..." if len(names) > 4 else "")


def _exchanged(images: ImageSet, seen: dict[tuple[int, int], _Seen]) -> tuple[str, ...]:
    """Folders that belong to another camera: a body turns as one, whichever camera looks at it."""
    cameras = images.rig.cameras
    if not 1 < len(cameras) <= _MOST_SWAPPED:
        return ()
    shots = [[seen.get((k, c)) for c in range(len(cameras))] for k in range(len(images.instants))]
    turns = np.array([[np.full(3, np.nan) if s is None else s.turn_rad for s in row] for row in shots])
    turns = turns[np.isfinite(turns).all(axis=(1, 2))]
    R_body_camera = np.array([camera.T_body_camera[:3, :3] for camera in cameras])
    sizes = [(camera.width, camera.height) for camera in cameras]

    def fits(order: tuple[int, ...]) -> NDArray[np.bool_]:
        """(k,) whether all cameras turn alike between two instants."""
        turned = np.einsum("cij,kcj->kci", R_body_camera[list(order)], turns)
        return (np.linalg.norm(turned - turned.mean(axis=1, keepdims=True), axis=2) < _TURN_RAD).all(axis=1)

    given = tuple(range(len(cameras)))
    orders = [o for o in itertools.permutations(given) if [sizes[k] for k in o] == sizes]
    best = max(orders, key=lambda order: fits(order).sum())  # the given one is the first of equals
    telling, against = (fits(best) & ~fits(given)).sum(), (fits(given) & ~fits(best)).sum()
    if telling < max(_LEAST_TELLING, _CLEARER * against):
        return ()
    return tuple(cameras[k].folder for k in given if best[k] != k)


def _swap_problem(exchanged: tuple[str, ...], why: str) -> list[str]:
    if not exchanged:
        return []
    return [
        f"the folders {', '.join(exchanged)} seem to be exchanged: {why}; exchange them, or the cameras in the camera "
        "file"
    ]
