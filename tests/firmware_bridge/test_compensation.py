"""The table of compensated effects: complete, and true of every effect it says is cancelled."""

import numpy as np
import pytest

import vehicle
from firmware_bridge import controller
from flight import InputError, rotations
from vehicle import effects, invert
from vehicle.simulation.simulate import Battery

BASE = vehicle.example("rigter2019")
TABLE = controller.compensated_effects()
CANCELLED = [name for name, entry in TABLE.items() if entry]
FLAT = BASE.without_effect("thrust_bem").with_effect("thrust_quadratic", k_n_s2=1.9e-6)
"""The paper's vehicle with the plain law, for the effects that only make sense with it."""
UNLIKE = {
    "thrust_bem": (BASE, FLAT),
    "thrust_quadratic": (FLAT, BASE),
    "rotor_yaw_torque": (BASE.with_value("rotor_yaw_torque.torque_n_m_s2", 6e-8), BASE),
}
"""Effects that cannot be switched off: the truth, and a vehicle with the rival or another value."""


def _planted(name):
    """The vehicle with the effect at the size its own self-test plants, and the vehicle without it."""
    if name in UNLIKE:
        return UNLIKE[name]
    base = FLAT if TABLE[name].only_with == "thrust_quadratic" else BASE
    without = base.without_effect(name) if name in base.effects else base
    size = 5.0 if name == "angular_damping" else 1.0  # the self-test's is lost in the attitude loop's other errors
    values = {spec.name: size * spec.planted for spec in effects.catalogue()[name].parameters}
    return without.with_effect(name, **values), without


TURNING = ("angular_damping", "rotor_yaw_torque")
"""Effects that are about turning: judged by the attitude error on a curve that turns."""


def _error(name, flight, curves):
    """Mean position error in metres, or mean attitude error in radians."""
    if name in TURNING:
        flight.fly(curves.general(turns=1))
        rows = [row for row in flight.log if row["state"] == controller.State.TRAJECTORY]
        q, wanted = (np.array([row[key] for row in rows]) for key in ("q_world_body", "q_reference"))
        return rotations.angle_between(q, wanted).mean()
    curve = curves.vertical(turns=2) if name == "inflow_linear" else curves.figure_eight(turns=1)
    return flight.fly(curve).mean()


def test_the_table_names_every_effect_of_the_catalogue_and_no_other():
    assert set(TABLE) == set(effects.catalogue())
    assert all(entry.how for entry in TABLE.values())


def test_the_table_names_every_parameter_of_the_effects_it_cancels():
    by_body = {"centre_of_mass", "payload"}
    unused = {"motor_lag": {"fall_s"}}
    for name in set(CANCELLED) - by_body:
        parameters = {spec.name for spec in effects.catalogue()[name].parameters}
        assert set(TABLE[name].targets) == parameters - unused.get(name, set()), name
        for targets in TABLE[name].targets.values():
            assert set(targets) <= set(controller.PARAMETERS), name


@pytest.mark.parametrize("name", CANCELLED)
def test_a_cancelled_effect_is_tracked_better_when_the_controller_knows_it(name, flight_of, curves):
    truth, without = _planted(name)
    battery = Battery(full_v=14.8) if name == "battery_sag" else None
    assert name not in controller.parameters_of(truth).not_compensated
    known, unknown = (
        _error(name, flight_of(truth=truth, believed=believed, battery=battery), curves)
        for believed in (truth, without)
    )
    assert known < 0.9 * unknown


def test_effects_that_are_not_compensated_are_reported():
    active = controller.parameters_of(BASE.with_effect("gyroscopic_torque").with_effect("inflow_linear"))
    assert set(active.not_compensated) == {"gyroscopic_torque", "inflow_linear"}  # the latter needs the plain law
    assert controller.parameters_of(FLAT.with_effect("inflow_linear")).not_compensated == ()


def test_a_payload_changes_mass_inertia_and_centre_of_mass():
    loaded = BASE.with_effect("payload", added_kg=0.1, x_m=0.02, y_m=0.0, z_m=-0.03)
    bare, full = (controller.parameters_of(v).parameters for v in (BASE, loaded))
    assert full["mass_kg"] == pytest.approx(0.8)
    assert full["com_x_m"] == pytest.approx(bare["com_x_m"] + (0.02 - bare["com_x_m"]) / 8)
    assert full["inertia_yy"] > bare["inertia_yy"]
    assert np.allclose([full["inertia_xx"], full["inertia_yy"]], np.diag(vehicle.rigid_body(loaded).inertia_kg_m2)[:2])


def _with_curves():
    """As a fit by motor commands finds them: thrust and torque with lower terms than squares."""
    return FLAT.with_effect("thrust_affine", constant_n=-0.2, slope_n_s=4e-4).with_effect(
        "torque_affine", slope_n_m_s=6e-6
    )


def test_squares_agree_with_curves_of_thrust_and_torque_at_hover(flight_of, curves):
    curved = _with_curves()
    found = controller.parameters_of(curved)
    weight_n = curved.mass_kg * curved.gravity_m_s2
    speed = invert.rotor_speeds(curved, weight_n, np.zeros(3), np.zeros(3), np.zeros(3)).mean()
    assert 4.0 * found.parameters["quad_n_s2"] * speed**2 == pytest.approx(
        weight_n, rel=1e-4
    )  # its centre of mass is off
    slope = curved.value("torque_affine.slope_n_m_s")
    torque = curved.value("rotor_yaw_torque.torque_n_m_s2") * speed**2 + slope * speed
    assert found.parameters["cq_n_m_s2"] * speed**2 == pytest.approx(torque, rel=1e-3)
    assert {"thrust_affine", "torque_affine"} <= set(found.not_compensated)
    known, unknown = (
        flight_of(truth=curved, believed=believed).fly(curves.figure_eight(turns=1)).mean()
        for believed in (curved, FLAT)
    )
    assert known < 0.5 * unknown


def test_a_curve_of_thrust_that_never_carries_the_vehicle_is_refused():
    sinking = FLAT.with_effect("thrust_affine", constant_n=3.0, slope_n_s=0.0)
    with pytest.raises(InputError, match=r"no rotor speed makes the 1\.72 N of hover"):
        controller.parameters_of(sinking)


def test_a_curve_of_thrust_without_a_square_is_met_at_hover_too():
    line = FLAT.with_value("thrust_quadratic.k_n_s2", 0.0).with_effect("thrust_affine", constant_n=0.0, slope_n_s=2e-3)
    found, hover_n = controller.parameters_of(line).parameters, FLAT.mass_kg * FLAT.gravity_m_s2 / 4.0
    assert found["quad_n_s2"] * (hover_n / 2e-3) ** 2 == pytest.approx(hover_n)


def test_a_torque_with_the_spin_is_refused_and_one_of_the_line_alone_is_taken():
    curved = FLAT.with_effect("torque_affine", slope_n_m_s=6e-6)
    alone = controller.parameters_of(curved.without_effect("rotor_yaw_torque")).parameters["cq_n_m_s2"]
    own = FLAT.value("rotor_yaw_torque.torque_n_m_s2")
    assert alone == pytest.approx(controller.parameters_of(curved).parameters["cq_n_m_s2"] - own)
    with pytest.raises(InputError, match="a rotor in hover has no torque against its spin"):
        controller.parameters_of(FLAT.with_effect("torque_affine", slope_n_m_s=-1e-4))
