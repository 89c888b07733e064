"""An effect of the user's own: the code of the page in docs/ runs as printed."""

import contextlib
import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

import vehicle
from flight import FormatError, InputError, rotations
from flight.frames import GRAVITY_M_S2
from vehicle import dynamics, effects, flatness, forces, manoeuvres, native, simulate
from vehicle.effects.base import Effect, Spec, Stage
from vehicle.simulation import integrate

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "add_an_effect.md"


@pytest.fixture(scope="module")
def worked_example(tmp_path_factory):
    """The page's two code blocks: the effect file, written to disk, and the session that uses it, run."""
    effect, session = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    folder = tmp_path_factory.mktemp("own")
    (folder / "side_guard.py").write_text(effect)
    names: dict = {}
    with contextlib.chdir(folder):
        exec(session, names)
    return names | {"folder": folder}


def test_the_page_works_as_printed(worked_example):
    assert worked_example["recovery"].passed
    assert worked_example["again"].effects == worked_example["guarded"].effects
    assert 'effect_files = [\n    "side_guard.py",\n]' in (worked_example["folder"] / "guarded.toml").read_text()


def test_it_takes_part_in_wrench_flatness_and_simulation(worked_example):
    guarded = worked_example["guarded"]
    assert native.compiled(guarded) is None
    force, _ = vehicle.wrench(guarded, np.array([0.0, 5.0, 0.0]), np.zeros(3), np.full(4, 950.0))
    without, _ = vehicle.wrench(vehicle.example(), np.array([0.0, 5.0, 0.0]), np.zeros(3), np.full(4, 950.0))
    assert force[0, 1] - without[0, 1] == pytest.approx(-0.03 * 2.5 * 5.0)
    flat = flatness.state(guarded, manoeuvres.make("fast_level"), np.linspace(9.5, 12.0, 9))
    specific, _ = vehicle.acceleration(
        guarded, flatness.air_velocity_body(flat), flat.rate_body_rad_s, flat.rotor_speed_rad_s
    )
    world = rotations.rotate(flat.q_world_body, specific) - np.array([0, 0, GRAVITY_M_S2])
    np.testing.assert_allclose(world, flat.acceleration_world_m_s2, atol=1e-7)
    plant = simulate.Plant(guarded)
    plant.step(plant.rotor_speed_rad_s, 0.05)
    np.testing.assert_allclose(plant.position_world_m, 0.0, atol=1e-9)


def test_the_kernel_calls_it_back_and_flies_as_numpy_does(worked_example):
    guarded = worked_example["guarded"]
    assert native.for_stepping(guarded) is not None
    start = simulate.State(np.zeros(3), np.array([1.0, 6.0, 0.5]), rotations.exp(np.array([0.1, 0.2, 0.3])))
    rows, force = [start.row()[None], start.row()[None]], [np.zeros((1, 3)), np.zeros((1, 3))]
    world, volts = integrate.world_row((0.0, 0, 0), GRAVITY_M_S2, -np.inf, np.inf), np.array([[16.0]])
    for engine, row, specific in zip((integrate.stepper, integrate.numpy_stepper), rows, force, strict=True):
        engine(guarded)(world, np.array([[900.0, 950, 1000, 980]]), volts, 30, 1e-3, row, specific)
    np.testing.assert_allclose(rows[0], rows[1], atol=1e-12)
    np.testing.assert_allclose(force[0], force[1], atol=1e-12)
    plain = simulate.Plant(vehicle.example(), start)
    plain.step(np.array([900.0, 950, 1000, 980]), 0.03)
    assert np.abs(rows[0][0, :3] - plain.position_world_m).max() > 1e-5


REPLACING = Effect(
    name="replacing",
    number=0,
    stage=Stage.THRUST_FACTOR,
    apply=lambda flow, p: setattr(flow, "thrust_n", flow.thrust_n * p.factor),
    parameters=(Spec("factor", "1", prior=0.1, bounds=(0.0, 2.0), default=1.0, planted=0.8),),
    law="T k",
    source="test",
    channel="F_z",
    regressor="T",
    excited_by=("vertical",),
)


def test_an_effect_may_also_put_new_arrays_in_place_of_the_old():
    effects.register(REPLACING)
    weaker = vehicle.example().with_effect("replacing", factor=0.8)
    plant = simulate.Plant(weaker, simulate.hovering(vehicle.example(), np.zeros(3)))
    assert plant.specific_force_body_m_s2[2] == pytest.approx(0.8 * GRAVITY_M_S2, rel=1e-6)


def test_an_error_in_an_own_effect_comes_out_of_the_simulation():
    broken = dataclasses.replace(REPLACING, name="broken", apply=lambda flow, p: flow.no_such_thing)
    effects.register(broken)
    v = vehicle.example()
    with pytest.raises(AttributeError, match="no_such_thing"):
        simulate.Plant(v.with_effect("broken"), simulate.hovering(v, np.zeros(3)))


def test_its_derivatives_are_exact(worked_example):
    guarded, h = worked_example["guarded"], 1e-6
    rng = np.random.default_rng(0)
    velocity, rate, speed = rng.normal(0, 4, (20, 3)), rng.normal(0, 2, (20, 3)), rng.uniform(700, 1100, (20, 4))
    velocity[:, 2] = np.abs(velocity[:, 2])
    jacobian = vehicle.wrench_jacobian(guarded, velocity, rate, speed, parameters=["side_guard.drag_kg_m"])
    step = np.array([0.0, h, 0.0])
    up, down = (np.hstack(vehicle.wrench(guarded, velocity + s, rate, speed)) for s in (step, -step))
    np.testing.assert_allclose(jacobian.velocity[:, :, 1], (up - down) / (2 * h), atol=1e-6)
    more = guarded.with_value("side_guard.drag_kg_m", 0.03 + h)
    change = np.hstack(vehicle.wrench(more, velocity, rate, speed)) - jacobian.value
    np.testing.assert_allclose(jacobian.parameters[:, :, 0], change / h, atol=1e-5)
    plain = dynamics._six_numpy(guarded, np.hstack([velocity, rate, speed]), forces.NOTHING_KNOWN, False)
    np.testing.assert_array_equal(jacobian.value, plain)


def test_a_fleet_with_own_values_is_refused_for_an_own_effect(worked_example):
    guarded = worked_example["guarded"]
    states = [simulate.State(), simulate.State()]
    with pytest.raises(InputError, match="one by one"):
        simulate.Fleet(guarded, states, values={"mass_kg": np.array([0.7, 0.8])})


@pytest.mark.parametrize(
    ("text", "message"),
    [("1 / 0", "does not run: division"), ("x = 1", "defines no EFFECT"), ("def broken(", "does not run")],
)
def test_a_wrong_effect_file_is_refused_with_the_reason(tmp_path, text, message):
    (tmp_path / "own.py").write_text(text)
    with pytest.raises(FormatError, match=message):
        effects.load_file(tmp_path / "own.py")
    with pytest.raises(InputError, match="does not exist"):
        effects.load_file(tmp_path / "nothing.py")


def test_a_name_of_the_catalogue_is_not_replaced():
    with pytest.raises(InputError, match="taken by the catalogue"):
        effects.register(effects.find("payload"))


def test_two_different_files_may_not_share_a_name(worked_example, tmp_path):
    text = (worked_example["folder"] / "side_guard.py").read_text()
    (tmp_path / "copy.py").write_text(text)
    effects.load_file(tmp_path / "copy.py")
    (tmp_path / "other.py").write_text(text.replace("v_y\n", "2.0 * v_y\n"))
    with pytest.raises(InputError, match="rename one"):
        effects.load_file(tmp_path / "other.py")
