"""Which rotor speeds share a thrust and three torques among more than four rotors.

Four rotors have one answer. With more, the squared speeds u are the shortest vector that gives the wrench,

    u = W d,   W = B' (B B')^-1,

where B (4, r) is force along body z and torque by each squared speed at hover: the minimum-norm allocation (the
pseudo-inverse that PX4 and, up to its scale, ArduPilot's and Betaflight's mixers of regular frames use; Johansen and
Fossen, "Control allocation - a survey", Automatica 2013). d is found by Newton with every effect of the model included.
Nothing is moved to other rotors where one would have to leave its range: such a wrench is beyond the limits.
"""

from weakref import WeakKeyDictionary

import numpy as np

from flight import FloatArray, portable
from vehicle import dynamics
from vehicle.forces import open_air
from vehicle.model import Vehicle

_SHARES: WeakKeyDictionary[Vehicle, FloatArray] = WeakKeyDictionary()
_LEAST = 0.01
"""Of its squared speed that a step leaves to every rotor."""


def shares(vehicle: Vehicle) -> FloatArray:
    """W, (r, 4): squared rotor speeds by force along body z and torque, in air at rest at half the fastest speed."""
    if vehicle not in _SHARES:
        _SHARES[vehicle] = _shares(vehicle)
    return _SHARES[vehicle]


def sideways(vehicle: Vehicle) -> float:
    """Force across body z that a torque comes with, times the longest arm, over that torque: the worst axis.

    0 for upright rotors; the tangent of the lean for a ring of rotors that lean inwards. Flatness has no place for it:
    there the attitude comes first, from forces alone, and the torque from the attitude.
    """
    if vehicle.axis_body is None:
        return 0.0
    force = portable.product(_by_square(vehicle)[:2], shares(vehicle))[:, 1:]
    arm_m = np.hypot(vehicle.hub_body_m[:, 0], vehicle.hub_body_m[:, 1]).max()
    return float(arm_m * np.linalg.norm(force, axis=0).max())


def _by_square(vehicle: Vehicle) -> FloatArray:
    """(6, r) force and torque by each squared rotor speed, in air at rest at half the fastest speed."""
    speed, still = np.full((1, vehicle.rotors), 0.5 * vehicle.limits.rotor_speed_max_rad_s), np.zeros((1, 3))
    slope = dynamics.wrench_jacobian(vehicle, still, still, speed, surroundings=open_air(1, vehicle.rotors))
    return slope.rotor_speed[0] / (2.0 * speed)


def _shares(vehicle: Vehicle) -> FloatArray:
    by_square = _by_square(vehicle)[2:]
    return portable.product(by_square.T, portable.solve(portable.product(by_square, by_square.T), np.eye(4)))


def by_wrench(vehicle: Vehicle, slope: FloatArray, speed_rad_s: FloatArray) -> FloatArray:
    """(n, r, 4): small changes of rotor speed by small changes of force along body z and torque.

    Args:
        slope: (n, 4, r) of force and torque by rotor speed, at `speed_rad_s` (n, r).
    """
    if vehicle.rotors == 4:
        return np.asarray(np.linalg.inv(slope), dtype=np.float64)
    along = shares(vehicle) / (2.0 * speed_rad_s[:, :, None])
    return along @ np.linalg.inv(slope @ along)


def step(vehicle: Vehicle, slope: FloatArray, missing: FloatArray, speed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A Newton step on d: new rotor speeds (n, r), and the change (n, r) that the whole step asked for.

    Args:
        slope: (n, 4, r), as in `by_wrench`.
        missing: (n, 4) of the wrench.
    """
    share, square = shares(vehicle), speed * speed
    along = share / (2.0 * speed[:, :, None])
    by_d = portable.solve(np.einsum("nij,njk->nik", slope, along), missing[..., None])[..., 0]
    wanted = np.einsum("rk,nk->nr", share, by_d)
    # u = W d at the start too, whatever speeds it came with
    start = np.einsum("rk,nk->nr", share, _wrench_of(share, square))
    wanted = wanted + start - square
    falling = np.where(wanted < 0.0, -wanted / square, 0.0).max(axis=1, keepdims=True)
    length = np.minimum(1.0, (1.0 - _LEAST) / np.maximum(falling, 1e-12))
    return np.sqrt(square + length * wanted), wanted / (2.0 * speed)


def _wrench_of(share: FloatArray, square: FloatArray) -> FloatArray:
    """(n, 4) the d whose W d is nearest to squared speeds (n, r)."""
    normal = portable.product(share.T, share)
    return portable.solve(normal, portable.product(share.T, square.T)).T
