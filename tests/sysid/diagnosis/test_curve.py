"""A drawn curve becomes an effect: the file says the curve, holds its ends, and makes the error reduction."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import vehicle
from flight import FormatError, InputError
from sysid import Options, compare, identify
from sysid.diagnosis import diagnose
from sysid.diagnosis.curve import scaffold
from sysid.diagnosis.evidence.free_form import THRUST, UNIT, VARIABLE
from sysid.diagnosis.findings import OutsideFinding
from tests.sysid.diagnosis.test_diagnosis import flights, turning_when_climbing
from vehicle import Surroundings, forces, wrench_jacobian

UNSEEN = ("time", "x", "y", "constant", "voltage", *(f"dc_{i}/dt" for i in range(4)))
AT = np.linspace(-2.0, 3.0, 80)


def finding(channel: str = "M_z", variable: str = "v_z") -> OutsideFinding:
    """A gently bent curve in newtons or newton metres, drawn with a mass or inertia of 2."""
    return OutsideFinding(
        channel=channel,
        variable=variable,
        variable_unit=UNIT[variable],
        at=AT,
        acceleration=0.5 * np.sin(AT),
        band=np.full(80, 0.01),
        force_or_torque=2.0,
        gain=100.0,
        significance=1e-9,
        confidence=1.0,
    )


VELOCITY, RATE, SPEED = np.array([[1.3, -0.7, 0.4]]), np.array([[0.5, -0.4, 0.9]]), np.full((1, 4), 2.5)
"""Within the range of the curve whatever the variable."""


def around(rotor_acceleration: float = 1.5) -> Surroundings:
    q = np.array([[np.cos(0.3), 0.0, 0.0, np.sin(0.3)]])
    return Surroundings(q, np.array([1.2]), np.array([np.inf]), np.full((1, 4), rotor_acceleration))


def value_of(variable: str) -> float:
    v, w = VELOCITY[0], RATE[0]
    if variable.startswith("v_") and " " in variable:
        return float(np.prod([v["xyz".index(word[2])] for word in variable.split()]))
    if variable[:2] in ("v_", "w_"):
        return float((v if variable[0] == "v" else w)["xyz".index(variable[2])])
    table = {"speed": float(np.linalg.norm(v)), "height": 1.2, "heading": 0.6}
    return table.get(variable, 2.5 if variable.startswith("n_") else 1.5)


@pytest.mark.parametrize("form", ["spline", "polynomial"])
@pytest.mark.parametrize("variable", [n for n, v in VARIABLE.items() if n not in UNSEEN and v.rotor < 4])
@pytest.mark.parametrize("channel", ["F_x", "M_z"])
def test_the_file_adds_the_drawn_curve_in_its_channel_only(tmp_path: Path, channel: str, variable: str, form):
    name = f"drawn_{channel}_{form}_{list(VARIABLE).index(variable)}".lower()
    file = scaffold(finding(channel, variable), tmp_path / f"{name}.py", name=name, form=form)
    plain = vehicle.example()
    drawn = plain.with_effect_file(file)
    more = np.concatenate(forces.wrench_numpy(drawn, VELOCITY, RATE, SPEED, around()), axis=1)
    less = np.concatenate(forces.wrench_numpy(plain, VELOCITY, RATE, SPEED, around()), axis=1)
    expected = np.zeros(6)
    expected[["F_x", "F_y", "F_z", "M_x", "M_y", "M_z"].index(channel)] = np.sin(value_of(variable))
    assert np.abs((more - less)[0] - expected).max() < (0.002 if form == "spline" else 0.1)  # a cubic is no sine
    silent = drawn.with_value(f"{name}.scale", 0.0)
    assert np.array_equal(np.concatenate(forces.wrench_numpy(silent, VELOCITY, RATE, SPEED, around()), axis=1), less)


@pytest.mark.parametrize(("channel", "variable"), [("T", "n"), ("T", "s"), ("T", "v_z"), ("T_2", "n_2")])
def test_a_curve_of_thrust_changes_the_share_of_its_rotors(tmp_path: Path, channel: str, variable: str):
    name = f"drawn_{channel}_of_{variable}".lower()
    plain = vehicle.example()
    drawn = plain.with_effect_file(scaffold(finding(channel, variable), tmp_path / f"{name}.py", name=name))
    components = (VELOCITY.T, RATE.T, SPEED.T, around())
    before, after = (forces.evaluate(v, *components).thrust_n[:, 0] for v in (plain, drawn))
    arm = plain.hub_body_m[:, :2].T
    own = {"n": np.full(4, 2.5), "n_2": np.full(4, 2.5), "v_z": np.full(4, VELOCITY[0, 2])}
    own["s"] = -(VELOCITY[0, :2] @ arm) / np.linalg.norm(arm, axis=0)
    share = np.sin(own[variable]) if channel == THRUST else np.where(np.arange(4) == 2, np.sin(2.5), 0.0)
    assert after / before - 1.0 == pytest.approx(share, abs=0.02)
    assert vehicle.effects.find(name).channel == "F_z M_x M_y"


def test_a_curve_of_lift_adds_the_same_newtons_to_every_rotor(tmp_path: Path):
    plain = vehicle.example()
    drawn = plain.with_effect_file(scaffold(finding("L", "v_z"), tmp_path / "drawn_lift.py", name="drawn_lift"))
    components = (VELOCITY.T, RATE.T, SPEED.T, around())
    before, after = (forces.evaluate(v, *components).thrust_n[:, 0] for v in (plain, drawn))
    assert after - before == pytest.approx(np.full(4, np.sin(VELOCITY[0, 2])), abs=0.02)
    assert vehicle.effects.find("drawn_lift").channel == "F_z M_x M_y"


@pytest.mark.parametrize("form", ["spline", "polynomial"])
@pytest.mark.parametrize("variable", ["v_z", "speed", "heading", "height", "dn_2/dt"])
def test_derivatives_by_complex_steps_are_those_of_differences(tmp_path: Path, variable: str, form):
    name = f"slope_{form}_{list(VARIABLE).index(variable)}"
    file = scaffold(finding("F_y", variable), tmp_path / f"{name}.py", name=name, form=form)
    drawn = vehicle.example().with_effect_file(file)
    jacobian = wrench_jacobian(drawn, VELOCITY, RATE, SPEED, parameters=(f"{name}.scale",), surroundings=around())
    step = 1e-6

    def force(velocity: np.ndarray, surroundings: Surroundings) -> float:
        return float(forces.wrench_numpy(drawn, velocity, RATE, SPEED, surroundings)[0][0, 1])

    for axis in range(3):
        moved = step * np.eye(3)[axis]
        slope = (force(VELOCITY + moved, around()) - force(VELOCITY - moved, around())) / (2.0 * step)
        assert jacobian.velocity[0, 1, axis] == pytest.approx(slope, abs=1e-5)
    up, down = (replace(around(), height_m=np.array([1.2 + d])) for d in (step, -step))
    slope = (force(VELOCITY, up) - force(VELOCITY, down)) / (2.0 * step)
    assert jacobian.height[0, 1] == pytest.approx(slope, abs=1e-5)
    half = 0.3 + 0.5 * step
    turned = replace(around(), q_world_body=np.array([[np.cos(half), 0.0, 0.0, np.sin(half)]]))
    slope = (force(VELOCITY, turned) - force(VELOCITY, around())) / step
    assert jacobian.attitude[0, 1, 2] == pytest.approx(slope, abs=1e-4)


@pytest.mark.parametrize("form", ["spline", "polynomial"])
def test_beyond_the_range_flown_the_curve_keeps_its_end(tmp_path: Path, form):
    name = f"ends_{form}"
    drawn = vehicle.example().with_effect_file(scaffold(finding(), tmp_path / f"{name}.py", name=name, form=form))

    def torque(v_z: float) -> float:
        velocity = np.array([[0.0, 0.0, v_z]])
        return float(forces.wrench_numpy(drawn, velocity, np.zeros((1, 3)), np.full((1, 4), 900.0))[1][0, 2])

    assert torque(50.0) == pytest.approx(torque(3.0), abs=1e-9)
    assert torque(-50.0) == pytest.approx(torque(-2.0), abs=1e-9)
    assert abs(torque(3.0) - torque(-2.0)) > 0.5


def test_json_serves_as_well_as_the_finding(tmp_path: Path):
    first = scaffold(finding(), tmp_path / "first.py", name="from_either")
    second = scaffold(finding().as_dict(), tmp_path / "second.py", name="from_either")
    assert first.read_text() == second.read_text()
    assert len(first.read_text().splitlines()) < 50


def test_what_a_vehicle_cannot_know_becomes_no_effect(tmp_path: Path):
    for variable in UNSEEN:
        with pytest.raises(InputError, match=r"cannot become an effect|off by a constant"):
            scaffold(finding("F_x", variable), tmp_path / "no.py", name="no_effect")
    with pytest.raises(InputError, match="a tether"):
        scaffold(finding("F_x_world", "height"), tmp_path / "no.py", name="no_effect")
    assert not list(tmp_path.iterdir())


def test_nothing_is_overwritten_and_no_name_taken(tmp_path: Path):
    kept = tmp_path / "mine.py"
    kept.write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        scaffold(finding(), kept, name="new_effect")
    assert kept.read_text() == "mine"
    with pytest.raises(InputError, match="taken by the catalogue"):
        scaffold(finding(), tmp_path / "a.py", name="motor_lag")
    with pytest.raises(InputError, match="cannot name an effect"):
        scaffold(finding(), tmp_path / "a.py", name="No Name")
    with pytest.raises(FormatError, match="do not fit together"):
        scaffold(finding().as_dict() | {"at": [0.0, 1.0]}, tmp_path / "a.py", name="new_effect")


@pytest.mark.slow
def test_a_drawn_curve_as_an_effect_makes_the_unseen_error_fall(tmp_path: Path):
    training = flights(turning_when_climbing, 11, 16.0)
    unseen = flights(turning_when_climbing, 12, 10.0, spread=0.2)
    found = diagnose(training, vehicle.example(), held_out=unseen, auto=True)
    assert found.outside is not None
    assert (found.outside.channel, found.outside.variable) == ("M_z", "v_z")
    file = scaffold(found.outside, tmp_path / "climb.py", name="turning_when_climbing")
    options = Options(node_rate_hz=100.0, gusts="white")
    without = identify(training, vehicle.example(), options)
    drawn = identify(training, without.vehicle.with_effect_file(file), options)
    scale = drawn.estimate("turning_when_climbing.scale")
    assert abs(scale.value - 1.0) < 0.1
    judged = compare(unseen, {"without": without.vehicle, "drawn": drawn.vehicle}, options)
    attitude = {name: judged.errors[name]["attitude"][-1] for name in judged.errors}
    assert attitude["drawn"] < 0.5 * attitude["without"]
