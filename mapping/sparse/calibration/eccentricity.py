"""Eccentricity: a feature of some size is not seen where the centre of its patch of surface is.

A round patch seen at an angle, or by a wide lens, is larger on one side of its centre than on the other, as a circular
target is (Luhmann, "Eccentricity in images of circular and spherical targets", 2014). A few hundredths of a pixel, but
always in the same direction: with a baseline of 8 cm the floor below made a room .12 % too large.
"""

import dataclasses

import numpy as np

from flight import FloatArray, frames
from mapping.camera.adjustment import Observations
from mapping.camera.rig import Camera

_STEP_PX = 1.0
_LEAST_COSINE = 0.2
"""Of the angle between ray and normal: at a more grazing view no patch is small."""


def corrected(seen: Observations, size_px: FloatArray) -> Observations:
    """The features moved to the image of the centre of their patch of surface.

    The point that pixel x shows is range(x) ray(x). To the second order, a feature of size s then lies off the image of
    its patch's centre by -s^2 (grad log range + pinv(d ray / dx) laplacian(ray) / 2). The patch is taken to face its
    cameras in the mean: normals fitted to neighbouring points made the scale of a rendered room no truer.

    Args:
        size_px: (o,) standard deviation of the Gaussian in which each feature was found.
    """
    normal_world = _towards_cameras(seen)
    pixels = seen.pixels.copy()
    for number, camera in enumerate(seen.rig):
        own = np.flatnonzero(seen.index[:, 2] == number)
        point, instant, _ = seen.index[own].T
        R_world_camera = seen.T_world_body[instant, :3, :3] @ camera.T_body_camera[:3, :3]
        normal_camera = np.einsum("oji,oj->oi", R_world_camera, normal_world[point])
        pixels[own] -= size_px[own, None] ** 2 * shift_px(camera, pixels[own], normal_camera)
    return dataclasses.replace(seen, pixels=pixels)


def shift_px(camera: Camera, pixels: FloatArray, normal_camera: FloatArray) -> FloatArray:
    """How far a feature of 1 px is seen off the image of its patch's centre.

    Args:
        pixels: (o, 2). normal_camera: (o, 3) of the patch, in the camera frame, of either sign.

    Returns:
        (o, 2) px; 0 at the edge of the field of view.
    """
    steps = _STEP_PX * np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    ray, right, left, below, above = (camera.unproject(pixels + step) for step in steps)
    slope = np.stack([right - left, below - above], axis=2) / (2.0 * _STEP_PX)
    laplacian = (right + left + below + above - 4.0 * ray) / _STEP_PX**2
    cosine = np.einsum("oi,oi->o", normal_camera, ray)
    cosine = np.copysign(np.maximum(np.abs(cosine), _LEAST_COSINE), cosine)
    by_range = -np.einsum("oik,oi->ok", slope, normal_camera) / cosine[:, None]
    transposed = np.swapaxes(slope, 1, 2)
    by_lens = 0.5 * np.linalg.solve(transposed @ slope, transposed @ laplacian[:, :, None])[:, :, 0]
    return np.nan_to_num(-(by_range + by_lens))


def _towards_cameras(seen: Observations) -> FloatArray:
    """(m, 3) unit vectors, in the mean over the images that see a point."""
    point, instant, number = seen.index.T
    centres_body = np.array([camera.T_body_camera[:3, 3] for camera in seen.rig])
    ray = frames.apply(seen.T_world_body[instant], centres_body[number]) - seen.points_world[point]
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    total = np.zeros_like(seen.points_world)
    np.add.at(total, point, ray)
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-9))
