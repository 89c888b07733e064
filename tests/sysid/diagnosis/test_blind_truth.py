"""The truth of the blind campaigns: RotorPy's equations exactly, and laws that agree with the catalogue's."""

import ast
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import vehicle
from vehicle import effects
from vehicle.effects.base import Flow, Stage

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"
rotorpy = pytest.importorskip("rotorpy.vehicles.multirotor", reason="RotorPy is a development dependency")
COUNT = 30


@pytest.fixture(scope="module", autouse=True)
def benchmarks_on_path():
    sys.path.insert(0, str(BENCHMARKS))
    yield
    sys.path.remove(str(BENCHMARKS))


@pytest.fixture(scope="module")
def parameters():
    from rotorpy.vehicles.hummingbird_params import quad_params

    rng = np.random.default_rng(0)
    found = []
    for _ in range(COUNT):
        p = dict(quad_params) | {"k_flap": 2e-6, "tau_m": 0.02, "kp_att": 260.0, "kd_att": 26.0}
        for name in ("mass", "Ixx", "Iyy", "Izz", "k_eta", "k_m", "k_d", "k_z", "k_h", "c_Dx", "c_Dy", "c_Dz"):
            p[name] = p[name] * rng.uniform(0.7, 1.3)
        p |= dict(zip(("Ixy", "Ixz", "Iyz"), 2e-4 * rng.standard_normal(3), strict=True))
        p["rotor_pos"] = {n: r + 0.005 * rng.standard_normal(3) for n, r in quad_params["rotor_pos"].items()}
        found.append(p)
    return found


@pytest.fixture(scope="module")
def states():
    rng = np.random.default_rng(1)
    blocks = [3.0 * rng.standard_normal((3, COUNT)), 5.0 * rng.standard_normal((3, COUNT))]
    blocks += [rng.standard_normal((4, COUNT)), 4.0 * rng.standard_normal((3, COUNT))]
    state = np.concatenate([*blocks, rng.uniform(200.0, 900.0, (4, COUNT))])
    state[6:10] /= np.linalg.norm(state[6:10], axis=0)
    return state


def their_body(p):
    from blind_flight import GRAVITY_M_S2

    body = rotorpy.Multirotor(p)
    body.g, body.weight = GRAVITY_M_S2, np.array([0.0, 0.0, -body.mass * GRAVITY_M_S2])
    return body


def test_the_batch_moves_as_rotorpy_says(parameters, states):
    import blind_flight

    rng = np.random.default_rng(2)
    wind, command = rng.standard_normal((3, COUNT)), rng.uniform(200.0, 900.0, (4, COUNT))
    mine = blind_flight.slope(blind_flight.Fleet.of(parameters), states, command, wind, 0.0, blind_flight.Sky())
    for i, p in enumerate(parameters):
        row = np.concatenate([states[:13, i], wind[:, i], states[13:, i]])
        theirs = their_body(p)._s_dot_fn(0.0, row, command[:, i])
        np.testing.assert_allclose(mine[:, i], np.delete(theirs, [13, 14, 15]), atol=1e-9, rtol=1e-12)


def test_the_batch_is_controlled_as_rotorpy_would(parameters, states):
    import blind_flight
    from rotorpy.controllers.quadrotor_control import SE3Control

    rng = np.random.default_rng(3)
    place, pace, bend = rng.standard_normal((3, 3, COUNT))
    yaw, yaw_rate = rng.standard_normal((2, COUNT))
    target = blind_flight.Reference(place, pace, bend, yaw, yaw_rate)
    mine = blind_flight.se3_command(blind_flight.Fleet.of(parameters), states, target)
    for i, p in enumerate(parameters):
        control = SE3Control(p)
        control.g, control.kp_pos, control.kd_pos = (
            blind_flight.GRAVITY_M_S2,
            blind_flight.POSITION_GAIN,
            blind_flight.VELOCITY_GAIN,
        )
        state = {"x": states[:3, i], "v": states[3:6, i], "q": states[6:10, i], "w": states[10:13, i]}
        flat = {"x": place[:, i], "x_dot": pace[:, i], "x_ddot": bend[:, i], "yaw": yaw[i], "yaw_dot": yaw_rate[i]}
        np.testing.assert_allclose(mine[:, i], control.update(0.0, state, flat)["cmd_motor_speeds"], atol=1e-9)


def test_half_a_second_ends_where_rotorpy_ends(parameters):
    import blind_flight

    fleet = blind_flight.Fleet.of(parameters[:3])
    state = np.zeros((17, 3))
    state[9], state[13:] = 1.0, 480.0
    command = 480.0 + np.array([30.0, -20.0, 25.0, -30.0])[:, None] * np.ones(3)
    wind = np.array([1.0, -0.5, 0.2])[:, None] * np.ones(3)
    path = state
    for i in range(200):
        path = blind_flight.advance(fleet, path, command, wind, 0.0025 * i, 0.0025, blind_flight.Sky())
    for i, p in enumerate(parameters[:3]):
        body = their_body(p)
        body.integrator_kwargs = {"rtol": 1e-11, "atol": 1e-12}
        start = {"x": state[:3, i], "v": state[3:6, i], "q": state[6:10, i], "w": state[10:13, i]}
        start |= {"wind": wind[:, i], "rotor_speeds": state[13:, i]}
        end = body.step(start, {"cmd_motor_speeds": command[:, i]}, 0.5)
        np.testing.assert_allclose(path[:3, i], end["x"], atol=1e-6)
        np.testing.assert_allclose(path[6:10, i], end["q"], atol=1e-6)
        np.testing.assert_allclose(path[10:13, i], end["w"], atol=1e-5)


def _laws():
    import blind_truth as t

    radius, density = 0.10, 1.225
    return {
        "weak_rotor": (t.TiredRotor(2, 0.05), {"loss_2": 0.05}),
        "ground_effect": (t.GroundCushion(1.3, radius), {"strength": 1.3}),
        "descent_loss": (t.VortexRing(0.25, radius, density), {"depth": 0.25}),
        "thrust_affine": (t.AffineThrust(-0.08, 3e-4), {"constant_n": -0.08, "slope_n_s": 3e-4}),
        "rotor_interaction": (t.WakeOnRear(0.006), {"loss_s_m": 0.006}),
        "rotor_drag_thrust": (t.ThrustScaledDrag(0.02), {"drag_s_m": 0.02}),
        "parasitic_drag": (t.DragPerAxis(0.006, 0.02), {"drag_xy_kg_m": 0.006, "drag_z_kg_m": 0.02}),
        "angular_damping": (
            t.SpinDamping(linear_n_m_s=(1e-3, 2e-3, 5e-4)),
            {"x_n_m_s": 1e-3, "y_n_m_s": 2e-3, "z_n_m_s": 5e-4},
        ),
        "angular_damping_quadratic": (
            t.SpinDamping(quadratic_n_m_s2=(1e-3, 2e-3, 5e-4)),
            {"x_n_m_s2": 1e-3, "y_n_m_s2": 2e-3, "z_n_m_s2": 5e-4},
        ),
        "torque_affine": (t.RotorFriction(4e-6), {"slope_n_m_s": 4e-6}),
        "gyroscopic_torque": (t.RotorGyroscope(1e-5), {"rotor_inertia_kg_m2": 1e-5}),
        "rotor_acceleration_torque": (t.RotorSpinUp(1e-5), {"rotor_inertia_kg_m2": 1e-5}),
        "airframe_side_moment": (t.SideMoment((1e-4, -6e-5, 2e-4)), {"x_kg": 1e-4, "y_kg": -6e-5, "z_kg": 2e-4}),
    }


@pytest.mark.parametrize("name", sorted(["weak_rotor", "ground_effect", "descent_loss", "thrust_affine",
    "rotor_interaction", "rotor_drag_thrust", "parasitic_drag", "angular_damping", "angular_damping_quadratic",
    "gyroscopic_torque", "rotor_acceleration_torque", "airframe_side_moment", "torque_affine"]))  # fmt: skip
def test_the_truths_law_is_the_catalogues_though_they_share_no_line(name, states):
    """Adding the effect changes our wrench as much as the extra changes the truth's."""
    import blind_flight
    from blind_campaigns import vehicle_file
    from blind_draw import draw

    truth = draw("none", np.random.default_rng(4))
    body = truth.body | {"rotor_pos": {n: np.asarray(r) for n, r in truth.body["rotor_pos"].items()}}
    ours = vehicle_file(truth, "law", np.random.default_rng(5))
    ours = _exact(ours, truth)
    extra, values = _laws()[name]
    fleet = blind_flight.Fleet.of([body] * COUNT)
    states = states.copy()
    states[2] = np.abs(states[2]) * 0.2 + 0.1
    command = states[13:] + 50.0
    wind = np.zeros((3, COUNT))
    sky = blind_flight.Sky(((slice(0, COUNT), extra),))
    slopes = blind_flight.slope(fleet, states, command, wind, 0.0, sky)
    rotation = blind_flight.matrix(states[6:10])
    around = vehicle.Surroundings(
        q_world_body=np.roll(states[6:10].T, 1, axis=1),
        height_m=states[2],
        rotor_acceleration_rad_s2=(slopes[13:]).T,
    )
    velocity = blind_flight.turned_back(rotation, states[3:6])
    model = ours.with_effect(name, **values)
    force, turn = vehicle.acceleration(model, velocity.T, states[10:13].T, states[13:].T, around)
    slopes[5] += blind_flight.GRAVITY_M_S2
    np.testing.assert_allclose(force.T, blind_flight.turned_back(rotation, slopes[3:6]), atol=1e-9)
    np.testing.assert_allclose(turn.T, slopes[10:13], atol=1e-9, rtol=1e-11)


def _exact(model, truth):
    """The vehicle file with the truth's own numbers in place of the data sheet's."""
    from blind_campaigns import _known_values

    body = truth.body
    sizes = {f"inertia_{axis}_kg_m2": body["I" + axis] for axis in ("xx", "yy", "zz")} | {"mass_kg": body["mass"]}
    sizes |= {"thrust_quadratic.k_n_s2": body["k_eta"], "rotor_yaw_torque.torque_n_m_s2": body["k_m"]}
    sizes |= {f"{e}.{p}": x for e, values in _known_values(truth).items() for p, x in values.items()}
    for name, value in sizes.items():
        model = model.with_value(name, value)
    return model


@pytest.mark.parametrize(
    "file", ["blind_truth.py", "blind_flight.py", "blind_manoeuvres.py", "blind_draw.py", "blind_forms.py"]
)
def test_the_truth_uses_nothing_of_ours(file):
    tree = ast.parse((BENCHMARKS / file).read_text())
    names = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    names |= {n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    assert not {n.split(".")[0] for n in names} & {"vehicle", "sysid", "flight", "planner", "goshawk"}
    assert names


@pytest.mark.parametrize("family", ["damping", "drag", "cushion", "lift", "moment", "sink", "wake", "rotor"])
def test_a_law_of_another_form_acts_and_is_not_the_catalogues(family, states):
    """It changes the motion, and no size of the nearest effect of the catalogue changes it in the same way."""
    import blind_flight
    import blind_forms
    from blind_campaigns import vehicle_file
    from blind_draw import draw

    truth = draw("none", np.random.default_rng(4))
    body = truth.body | {"rotor_pos": {n: np.asarray(r) for n, r in truth.body["rotor_pos"].items()}}
    form = blind_forms.FORMS[family](np.random.default_rng(6), truth.body["rotor_radius"])
    fleet = blind_flight.Fleet.of([body] * COUNT)
    states = states.copy()
    states[2] = np.abs(states[2]) * 0.2 + 0.1
    command, wind = states[13:] + 50.0, np.zeros((3, COUNT))
    plain, changed = (
        blind_flight.slope(fleet, states, command, wind, 0.0, blind_flight.Sky(extras))
        for extras in ((), ((slice(0, COUNT), form.extra),))
    )
    rotation = blind_flight.matrix(states[6:10])
    more = np.concatenate([blind_flight.turned_back(rotation, (changed - plain)[3:6]), (changed - plain)[10:13]])
    assert np.abs(more).max() > 0.01
    ours = _exact(vehicle_file(truth, "form", np.random.default_rng(5)), truth)
    velocity = blind_flight.turned_back(rotation, states[3:6])
    around = vehicle.Surroundings(np.roll(states[6:10].T, 1, axis=1), states[2], rotor_acceleration_rad_s2=plain[13:].T)
    for name in set(form.near) - {"thrust_bem"}:
        model = ours if name in ours.effects else ours.with_effect(name)
        names = [f"{name}.{s.name}" for s in vehicle.effects.find(name).parameters]
        flown = (velocity.T, states[10:13].T, states[13:].T)
        found = vehicle.acceleration_jacobian(model, *flown, parameters=names, surroundings=around)
        columns = found.parameters.reshape(-1, len(names))
        size = np.linalg.lstsq(columns, more.T.ravel(), rcond=None)[0]
        left = more.T.ravel() - columns @ size
        assert np.linalg.norm(left) > 0.02 * np.linalg.norm(more), name


def test_conditions_are_drawn_in_their_shares_and_apart_from_each_other():
    import blind_campaigns

    drawn = blind_campaigns.conditions(120, np.random.default_rng(0))
    assert (sum(c.gusts for c in drawn), sum(c.offset for c in drawn), sum(c.commands for c in drawn)) == (80, 40, 20)
    assert 0 < sum(c.gusts and c.offset and not c.commands for c in drawn) < 40


def test_a_log_of_commands_alone_holds_command_and_battery_and_no_rotor_speed():
    import blind_campaigns
    from blind_draw import Conditions, draw

    rng = np.random.default_rng(11)
    truth = draw("none", rng, Conditions(gusts=False, commands=True))
    (made,) = blind_campaigns.fly([truth], [rng], 2.0)
    log = blind_campaigns.measure(made[0], truth, False, rng)
    assert not log.has("rotor_speed_rad_s")
    assert log.has("rotor_speed_command_rad_s")
    assert log.columns["battery_v"][0] - log.columns["battery_v"][-1] == pytest.approx(truth.drop_v, abs=0.2)
    assert "motor_lag" in blind_campaigns.vehicle_file(truth, "commands", rng).effects


@pytest.mark.parametrize("kind", ["single", "pair", "none", "outside", "foreign", "form"])
def test_a_draw_says_what_it_hides(kind):
    from blind_draw import HIDDEN, draw

    for seed in range(40):
        truth = draw(kind, np.random.default_rng(seed))
        assert not set(truth.hidden) & truth.known
        assert set(truth.hidden) <= set(HIDDEN)
        assert len(truth.hidden) in {"single": {1}, "pair": {2}, "foreign": {0, 1}}.get(kind, {0})
        assert bool(truth.channels) == (kind in ("outside", "form"))
        assert bool(truth.near) == (kind == "form")
        assert bool(truth.real) == (kind == "foreign") == bool(truth.believed)


def test_the_nearest_law_to_a_moment_that_saturates_counts_as_right():
    """Nearest is the law of the catalogue whose best fit over the speeds flown leaves least of the moment."""
    import blind_flight
    import blind_forms

    rng = np.random.default_rng(7)
    velocity = np.clip(2.2 * rng.standard_normal((3, 2000)), -7.0, 7.0)
    speed = 450.0 + 30.0 * rng.standard_normal((4, 2000))
    hub = 0.17 * np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0], [0.0, 0.0, 0.0, 0.0]])[:, :, None]

    def moment_of(effect: effects.Effect, parameter: str) -> np.ndarray:
        flow = Flow(velocity, 0.0 * velocity, speed, hub, np.array([[1.0], [-1.0], [1.0], [-1.0]]), 0.1, 1.2)
        flow.thrust_n[:] = 1.2
        effect.apply(flow, SimpleNamespace(**{s.name: float(s.name == parameter) for s in effect.parameters}))
        return flow.torque_n_m[:2].ravel()

    moments = [e for e in effects.catalogue().values() if e.channel.startswith("M_x M_y") and e.stage is Stage.FORCE]
    nearest = set()
    for _ in range(10):
        form = blind_forms.FORMS["moment"](rng, 0.1)
        air = blind_flight.Air(0.0, *[0.0 * velocity] * 2, velocity, 0.0 * velocity, *[speed] * 2, hub, speed)
        true = form.extra.wrench(air, speed)[1][:2].ravel()
        left = {}
        for effect in moments:
            columns = np.stack([moment_of(effect, s.name) for s in effect.parameters], axis=1)
            left[effect.name] = np.square(true - columns @ np.linalg.lstsq(columns, true, rcond=None)[0]).sum()
        nearest.add(min(left, key=left.__getitem__))
        assert nearest <= set(form.near)
    assert "wake_skew_moment" in nearest
