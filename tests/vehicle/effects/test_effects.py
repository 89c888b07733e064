"""Every effect of the catalogue: compiled and plain forms agree, derivatives are exact, units and sources are there."""

import numpy as np
import pytest

import vehicle
from flight import InputError
from flight.frames import GRAVITY_M_S2
from vehicle import dynamics, effects, forces, native, simulate
from vehicle.effects.base import Stage
from vehicle.simulation import integrate

CATALOGUE = effects.catalogue()
MECHANICAL = [name for name, e in CATALOGUE.items() if e.stage not in (Stage.SENSOR, Stage.COMMAND, Stage.DRIVE)]


def planted(name):
    """A plain vehicle with one effect at its planted value."""
    effect = CATALOGUE[name]
    base = vehicle.example().without_effect("motor_lag")
    return base.with_effect(name, **{s.name: s.planted for s in effect.parameters})


def motion(n=200, seed=2):
    rng = np.random.default_rng(seed)
    velocity, rate, speed = rng.normal(0, 4, (n, 3)), rng.normal(0, 3, (n, 3)), rng.uniform(500, 1500, (n, 4))
    velocity[:, 2] = np.maximum(velocity[:, 2], -7.0)
    q = rng.normal(0, 1, (n, 4))
    around = vehicle.Surroundings(
        q / np.linalg.norm(q, axis=1, keepdims=True),
        rng.uniform(0.05, 0.5, n),
        rng.uniform(0.05, 0.5, n),
        rng.normal(0, 1000, (n, 4)),
    )
    return velocity, rate, speed, around


def test_the_catalogue_has_every_number_from_1_to_27():
    assert {e.number for e in CATALOGUE.values()} - {0} == set(range(1, 28))


@pytest.mark.parametrize("name", CATALOGUE)
def test_every_entry_has_law_source_channel_and_units(name):
    effect = CATALOGUE[name]
    assert all((effect.law, effect.source, effect.channel, effect.regressor, effect.excited_by))
    for spec in effect.parameters:
        low, high = spec.bounds
        assert low <= spec.default <= high
        assert low <= spec.planted <= high
        assert spec.prior > 0
        assert spec.unit


@pytest.mark.parametrize("name", [n for n, e in CATALOGUE.items() if e.stage != Stage.SENSOR])
def test_the_kernel_has_a_compiled_form_of_it(name):
    assert native.compiled(planted(name)) is not None


@pytest.mark.parametrize("name", MECHANICAL)
def test_compiled_and_plain_forms_agree(name):
    v, (velocity, rate, speed, around) = planted(name), motion()
    fast = vehicle.wrench(v, velocity, rate, speed, around)
    slow = forces.wrench_numpy(v, velocity, rate, speed, around)
    for a, b in zip(fast, slow, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-10, rtol=1e-12)
    quick = vehicle.acceleration(v, velocity, rate, speed, around)
    plain = dynamics.motion_numpy(v, velocity, rate, speed, around)[:2]
    for a, b in zip(quick, plain, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9, rtol=1e-12)


@pytest.mark.parametrize("name", MECHANICAL)
def test_its_derivatives_agree_with_complex_steps(name):
    v, (velocity, rate, speed, around) = planted(name), motion(60)
    names = [p for p in v.parameters if not p.startswith(("pose_sensor", "motor_lag"))]
    jacobian = vehicle.acceleration_jacobian(v, velocity, rate, speed, parameters=names, surroundings=around)
    rows = np.hstack([velocity, rate, speed])
    _, slopes = dynamics._complex_steps(v, rows, names, around, True)
    parts = [jacobian.velocity, jacobian.rate, jacobian.rotor_speed, jacobian.attitude, jacobian.height[..., None]]
    ours = np.concatenate([*parts, jacobian.rotor_acceleration, jacobian.parameters], axis=2)
    scale = np.abs(slopes).max(axis=(0, 1)) + 1e-12
    np.testing.assert_allclose(ours / scale, slopes / scale, atol=1e-8)


@pytest.mark.parametrize("name", MECHANICAL)
def test_it_changes_the_acceleration(name):
    velocity, rate, speed, around = motion()
    base = vehicle.example().without_effect("motor_lag")
    if name in base.effects:
        base = base.without_effect(name)
    without = vehicle.acceleration(base, velocity, rate, speed, around)
    with_it = vehicle.acceleration(planted(name), velocity, rate, speed, around)
    assert max(np.abs(a - b).max() for a, b in zip(without, with_it, strict=True)) > 1e-4


@pytest.mark.parametrize("name", ["battery_sag", "motor_lag"])
def test_motor_effects_integrate_alike_compiled_and_plain(name):
    v = planted(name)
    states = [simulate.hovering(v, np.zeros(3)).row()[None] for _ in range(2)]
    world = integrate.world_row((0.0, 0, 0), GRAVITY_M_S2, -np.inf, np.inf)
    command, volts = np.array([[900.0, 950, 1000, 980]]), np.array([[15.0]])
    for stepper, rows in zip((integrate.stepper(v), integrate.numpy_stepper(v)), states, strict=True):
        stepper(world, command, volts, 20, 1e-3, rows, np.zeros((1, 3)))
    np.testing.assert_allclose(states[0], states[1], atol=1e-10)


def test_a_missing_surrounding_is_named():
    v, (velocity, rate, speed, _) = planted("ground_effect"), motion()
    for call in (vehicle.wrench, forces.wrench_numpy, vehicle.wrench_jacobian):
        with pytest.raises(InputError, match="ground_effect reads height_m"):
            call(v, velocity, rate, speed)
