"""Force and torque on the body: the sum of the active effects, in plain NumPy.

This is the reference; `vehicle.wrench` runs the compiled kernel when every active effect has a compiled form.
"""

from dataclasses import astuple, dataclass

import numpy as np

from flight import FloatArray, InputError
from vehicle import effects as registry
from vehicle.effects.base import Array, Flow, Stage, cross
from vehicle.model import BODY, ValueMap, Vehicle, active, namespace, rigid_body, values_of


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Quantities that some effects read besides air speed, body rate and rotor speed. None where unavailable."""

    q_world_body: FloatArray | None = None
    """(n, 4), for wind given in world axes."""
    height_m: FloatArray | None = None
    """(n,) height above the ground."""
    ceiling_gap_m: FloatArray | None = None
    """(n,) free height above; infinite in the open."""
    rotor_acceleration_rad_s2: FloatArray | None = None
    """(n, r)."""


NOTHING_KNOWN = Surroundings()


def open_air(n: int, rotors: int = 4) -> Surroundings:
    """Level, far from ground and ceiling, rotors at steady speed."""
    level = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    return Surroundings(level, np.full(n, np.inf), np.full(n, np.inf), np.zeros((n, rotors)))


def evaluate(
    vehicle: Vehicle,
    velocity_m_s: Array,
    rate_rad_s: Array,
    rotor_speed_rad_s: Array,
    surroundings: Surroundings = NOTHING_KNOWN,
    values: ValueMap | None = None,
) -> Flow:
    """Run the effects over n instants given components first, (3, n), (3, n), (r, n); sums are complete in the result.

    Raises:
        InputError: an active effect reads a surrounding that was not given.
    """
    values = values_of(vehicle) if values is None else values
    known = [around for around in astuple(surroundings) if around is not None]
    dtype = np.result_type(velocity_m_s, rate_rad_s, rotor_speed_rad_s, *known, *values.values(), np.float64)
    centre = rigid_body(vehicle, values).centre_of_mass_m
    flow = Flow(
        velocity_m_s=np.array(velocity_m_s, dtype),
        rate_rad_s=np.asarray(rate_rad_s, dtype),
        rotor_speed_rad_s=np.asarray(rotor_speed_rad_s, dtype),
        hub_m=vehicle.hub_body_m.T[:, :, None] - centre.reshape(3, 1, -1),
        spin=vehicle.spin[:, None],
        radius_m=values["rotor_radius_m"],
        air_density_kg_m3=values["air_density_kg_m3"],
        q_world_body=_components_first(surroundings.q_world_body),
        height_m=surroundings.height_m,
        ceiling_gap_m=surroundings.ceiling_gap_m,
        rotor_acceleration_rad_s2=_components_first(surroundings.rotor_acceleration_rad_s2),
        tilt=None if vehicle.axis_body is None else tilts(vehicle.axis_body),
    )
    for name in active(vehicle, Stage.AIR, Stage.THRUST, Stage.THRUST_FACTOR, Stage.FORCE):
        effect = registry.find(name)
        for need in effect.needs:
            if getattr(flow, need) is None:
                raise InputError(f"effect {name} reads {need}; give it in the surroundings")
        effect.apply(flow, namespace(values, name, vehicle.rotors))
    _collect_hub_forces(flow)
    return flow


def _collect_hub_forces(flow: Flow) -> None:
    """Carry thrust and hub forces to the centre of mass."""
    flow.hub_force_n[2] += flow.thrust_n
    if flow.tilt is not None:
        flow.hub_force_n = np.einsum("ijr,jrn->irn", flow.tilt, flow.hub_force_n)
    flow.force_n += flow.hub_force_n.sum(axis=1)
    flow.torque_n_m += cross(flow.hub_m, flow.hub_force_n).sum(axis=1)


def tilts(axis_body: FloatArray) -> FloatArray:
    """(3, 3, r) rotations that turn z the shortest way to each axis (r, 3, unit): Rodrigues' formula."""
    x, y, z = axis_body.T
    share = 1.0 / (1.0 + z)
    return np.array(
        [[1.0 - x * x * share, -x * y * share, x], [-x * y * share, 1.0 - y * y * share, y], [-x, -y, z]], np.float64
    )


def wrench_numpy(
    vehicle: Vehicle,
    velocity_air_body_m_s: FloatArray,
    rate_body_rad_s: FloatArray,
    rotor_speed_rad_s: FloatArray,
    surroundings: Surroundings = NOTHING_KNOWN,
    values: ValueMap | None = None,
) -> tuple[Array, Array]:
    """As `vehicle.wrench`, without the compiled kernel; accepts complex arrays and values."""
    flow = evaluate(
        vehicle,
        np.atleast_2d(velocity_air_body_m_s).T,
        np.atleast_2d(rate_body_rad_s).T,
        np.atleast_2d(rotor_speed_rad_s).T,
        surroundings,
        values,
    )
    return flow.force_n.T, flow.torque_n_m.T


def _components_first(array: FloatArray | None) -> FloatArray | None:
    return None if array is None else np.atleast_2d(array).T


BODY_NAMES = tuple(s.name for s in BODY)
