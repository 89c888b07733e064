"""Rotations: quaternions w x y z, matrices, rotation vectors; all vectorised over leading axes.

`q_world_body` takes body coordinates to world coordinates. Products compose like matrices:
`multiply(q_world_body, q_body_camera)` is `q_world_camera`.
"""

import numpy as np
from numpy.typing import ArrayLike

from flight import portable
from flight.portable import FloatArray

IDENTITY: FloatArray = np.array([1.0, 0.0, 0.0, 0.0])


def normalise(q: ArrayLike) -> FloatArray:
    q = np.asarray(q, dtype=np.float64)
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def conjugate(q: ArrayLike) -> FloatArray:
    """The inverse of a unit quaternion: `conjugate(q_world_body)` is `q_body_world`."""
    return np.asarray(q, dtype=np.float64) * np.array([1.0, -1.0, -1.0, -1.0])


def multiply(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Hamilton product, (..., 4) by (..., 4)."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    w = aw * bw - ax * bx - ay * by - az * bz
    product = np.empty((*np.shape(w), 4))  # for few, np.stack takes longer than the products
    product[..., 0] = w
    product[..., 1] = aw * bx + ax * bw + ay * bz - az * by
    product[..., 2] = aw * by - ax * bz + ay * bw + az * bx
    product[..., 3] = aw * bz + ax * by - ay * bx + az * bw
    return product


def rotate(q: ArrayLike, vectors: ArrayLike) -> FloatArray:
    """Rotate vectors: `rotate(q_world_body, v_body)` is `v_world`. (..., 4) with (..., 3)."""
    q = np.asarray(q, dtype=np.float64)
    v = np.asarray(vectors, dtype=np.float64)
    w, u = q[..., :1], q[..., 1:]
    t = 2.0 * cross(u, v)
    return v + w * t + cross(u, t)


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product of vectors along the last axis, (..., 3) with (..., 3); np.cross is four times slower for few."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    x = ay * bz - az * by
    product = np.empty((*np.shape(x), 3))
    product[..., 0], product[..., 1], product[..., 2] = x, az * bx - ax * bz, ax * by - ay * bx
    return product


def exp(rotation_vector_rad: ArrayLike) -> FloatArray:
    """Quaternion of a rotation vector (axis times angle, radians), (..., 3) to (..., 4)."""
    r = np.asarray(rotation_vector_rad, dtype=np.float64)
    half = 0.5 * np.linalg.norm(r, axis=-1, keepdims=True)
    sine, cosine = portable.sine_cosine(half)
    share = np.where(half > 0.0, sine / np.where(half > 0.0, half, 1.0), 1.0)
    return np.concatenate([cosine, 0.5 * share * r], axis=-1)


def log(q: ArrayLike) -> FloatArray:
    """Rotation vector of a unit quaternion, angle in [0, pi]; q and -q give the same vector."""
    q = np.asarray(q, dtype=np.float64)
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * portable.arctangent2(sine, q[..., :1])
    # angle / sine tends to 2 / w as the angle goes to zero; below 1e-8 the difference is under rounding
    ratio = np.where(sine > 1e-8, angle / np.where(sine > 1e-8, sine, 1.0), 2.0 / np.maximum(q[..., :1], 1e-8))
    return ratio * q[..., 1:]


def matrix(q: ArrayLike) -> FloatArray:
    """Rotation matrix of a unit quaternion, (..., 4) to (..., 3, 3)."""
    q = np.asarray(q, dtype=np.float64)
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    R = np.empty((*q.shape[:-1], 3, 3))
    R[..., 0, 0], R[..., 0, 1], R[..., 0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    R[..., 1, 0], R[..., 1, 1], R[..., 1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    R[..., 2, 0], R[..., 2, 1], R[..., 2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return R


def from_matrix(R: ArrayLike) -> FloatArray:
    """Unit quaternion of a rotation matrix, (..., 3, 3) to (..., 4), with w >= 0 (Shepperd's choice of pivot)."""
    m = np.asarray(R, dtype=np.float64)
    m00, m11, m22 = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    # Four times the outer product q q^T; the row with the largest diagonal is q up to scale.
    outer = np.empty((*m.shape[:-2], 4, 4))
    outer[..., 0, 0] = 1 + m00 + m11 + m22
    outer[..., 1, 1] = 1 + m00 - m11 - m22
    outer[..., 2, 2] = 1 - m00 + m11 - m22
    outer[..., 3, 3] = 1 - m00 - m11 + m22
    outer[..., 0, 1] = outer[..., 1, 0] = m[..., 2, 1] - m[..., 1, 2]
    outer[..., 0, 2] = outer[..., 2, 0] = m[..., 0, 2] - m[..., 2, 0]
    outer[..., 0, 3] = outer[..., 3, 0] = m[..., 1, 0] - m[..., 0, 1]
    outer[..., 1, 2] = outer[..., 2, 1] = m[..., 0, 1] + m[..., 1, 0]
    outer[..., 1, 3] = outer[..., 3, 1] = m[..., 0, 2] + m[..., 2, 0]
    outer[..., 2, 3] = outer[..., 3, 2] = m[..., 1, 2] + m[..., 2, 1]
    pivot = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(outer, pivot[..., None, None], axis=-2)[..., 0, :]
    return normalise(np.where(q[..., :1] < 0.0, -q, q))


def angle_between(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Angle in radians of the rotation that takes one attitude to the other, in [0, pi]."""
    return np.linalg.norm(log(multiply(conjugate(a), b)), axis=-1)


def continuous(q: FloatArray) -> FloatArray:
    """The same attitudes (n, 4) in order of time, of `q` and `-q` the one that is nearer to the one before."""
    turns_back = (q[1:] * q[:-1]).sum(axis=-1) < 0.0
    return q * np.concatenate([[1.0], np.cumprod(np.where(turns_back, -1.0, 1.0))])[:, None]


def slerp(a: ArrayLike, b: ArrayLike, fraction: ArrayLike) -> FloatArray:
    """Constant-rate interpolation along the shorter arc; `fraction` (...,) 0 gives a, 1 gives b."""
    step = log(multiply(conjugate(a), b))
    return multiply(a, exp(np.asarray(fraction, dtype=np.float64)[..., None] * step))


def from_yaw(yaw_rad: ArrayLike) -> FloatArray:
    half = 0.5 * np.asarray(yaw_rad, dtype=np.float64)
    zero = np.zeros_like(half)
    sine, cosine = portable.sine_cosine(half)
    return np.stack([cosine, zero, zero, sine], axis=-1)


def yaw(q_world_body: ArrayLike) -> FloatArray:
    """Heading of the body x axis in the horizontal plane, radians, in (-pi, pi]."""
    w, x, y, z = np.moveaxis(np.asarray(q_world_body, dtype=np.float64), -1, 0)
    return portable.arctangent2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def wrapped(angle_rad: ArrayLike) -> FloatArray:
    """The same angles in [-pi, pi]."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


def hat(v: ArrayLike) -> FloatArray:
    """Cross-product matrix: `hat(a) @ b == cross(a, b)`, (..., 3) to (..., 3, 3)."""
    x, y, z = np.moveaxis(np.asarray(v, dtype=np.float64), -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
