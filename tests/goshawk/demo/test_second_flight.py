"""Back into the air: what was learned lowers the tracking error, and plans respect the new model."""

import importlib.util
import json
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import planner
import vehicle
from esdf import solids
from flight import Waypoints, trajectory
from goshawk.demo.chain import vehicles
from goshawk.demo.sitl_process import sitl_vehicle
from planner.gate import gate
from tests.goshawk.running import answer as goshawk

ROOT = Path(__file__).parents[3]
HALL = solids.Room((-7.0, -5.0, 0.0), (7.0, 5.0, 4.0))


@pytest.fixture(scope="module")
def benchmark_of():
    """Loads a benchmark script as a module."""

    def load(name: str) -> ModuleType:
        spec = importlib.util.spec_from_file_location(f"benchmark_{name}", ROOT / "benchmarks" / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module  # dataclasses look there for their own module
        spec.loader.exec_module(module)
        return module

    sys.path.insert(0, str(ROOT / "benchmarks"))
    yield load
    sys.path.remove(str(ROOT / "benchmarks"))


@pytest.fixture(scope="module")
def loops(benchmark_of):
    """The hidden effects and their flights."""
    return benchmark_of("back_into_the_air")


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["rotor_drag_thrust", "centre_of_mass", "weak_rotor", "flapping_moment"])
def test_the_second_flight_tracks_as_well_as_with_the_true_model(loops, effect):
    flown = loops.second(effect)
    assert flown.after_m < 0.5 * flown.before_m
    assert flown.after_m < 1.15 * flown.known_m
    assert not flown.not_compensated


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["rotor_drag_thrust", "centre_of_mass", "weak_rotor"])
def test_a_diagnosis_of_its_logs_makes_the_second_flight_as_good_without_a_given_effect(loops, effect):
    flown = loops.second(effect, given=False)
    assert flown.added == (effect,)
    assert flown.after_m < 0.5 * flown.before_m
    assert flown.after_m < 1.15 * flown.known_m


@pytest.mark.slow
def test_an_effect_that_the_controller_does_not_compensate_is_reported(loops):
    flown = loops.second("airframe_side_moment")
    assert flown.not_compensated == ("airframe_side_moment",)


def eight() -> Waypoints:
    turn = np.linspace(0.0, 2.0 * np.pi, 9)
    points = np.stack([5.0 * np.sin(turn), 2.8 * np.sin(2.0 * turn), 1.6 + 0.5 * np.cos(turn)], axis=1)
    return Waypoints(points, np.full(9, np.nan))


def rotor_speed(report: planner.GateReport) -> planner.gate.limits.Check:
    return next(check for check in report.checks if check.name == "rotor speed")


def test_a_plan_for_the_learned_model_keeps_the_reserve_that_a_weak_rotor_has_lost():
    """Rotors to 1230 rad/s suffice for the healthy model; with a weak rotor that plan fails, and a new one passes."""
    believed = vehicles()[0].with_limits(
        rotor_speed_max_rad_s=1230.0, speed_m_s=8.0, acceleration_m_s2=10.0, tilt_rad=1.0
    )
    learned = believed.with_effect("weak_rotor", loss_1=0.15)
    old = planner.plan(eight(), HALL, believed)
    again = gate.check(old.trajectory, HALL, learned)
    assert rotor_speed(old.gate).passed
    assert not rotor_speed(again).passed
    new = planner.plan(eight(), HALL, learned)
    assert new.gate.passed
    assert rotor_speed(new.gate).value <= 1230.0
    assert new.trajectory.duration_s > old.trajectory.duration_s


def run(*arguments: object, code: int = 0) -> dict:
    answer = goshawk(*arguments, "--json")
    assert answer.returncode == code, answer.stdout + answer.stderr
    return json.loads(answer.stdout)


@pytest.fixture
def project(pillar_map, tmp_path):
    """A plan for a believed vehicle, and what was learned since."""
    believed = vehicles()[1]
    vehicle.save(tmp_path / "believed.toml", believed)
    vehicle.save(tmp_path / "learned.toml", believed.with_effect("rotor_drag_thrust", drag_s_m=0.0175))
    import mapping

    area = mapping.open_map(pillar_map)
    straight = Waypoints(np.array([[0.8, 0.8, 1.0], [5.2, 0.8, 1.2]]), np.full(2, np.nan))
    planner.save_plan(tmp_path / "walk.json", planner.plan(straight, area.field, believed), name="walk")
    return tmp_path


def test_after_learning_a_plan_is_renewed_and_the_controller_set_before_anything_is_uploaded(project, pillar_map):
    learned = ("--map", pillar_map, "--vehicle", project / "learned.toml")
    file = project / "walk.json"
    assert not run("check", file, *learned, code=1)["passed"]
    assert run("check", file, *learned, "--renew")["passed"]
    assert run("check", file, *learned)["passed"]
    key = project / "link.key"
    options = ("--vehicle", project / "believed.toml", "--start-of", file, "--time-factor", 0)
    with sitl_vehicle(*options, key_file=key) as url:
        link = ("--url", url, "--key", key)
        refused = run("upload", file, "--vehicle", project / "learned.toml", *link, code=2)["error"]["message"]
        assert "rotor_drag_s_m 0 (model 0.0175)" in refused
        assert "goshawk params set --vehicle" in refused
        run("params", "set", "--vehicle", project / "learned.toml", "--yes", *link)
        assert run("upload", file, "--vehicle", project / "learned.toml", *link)["read_back_equal"]


def test_a_plan_that_fails_for_the_new_model_is_not_renewed(project, pillar_map):
    slow = vehicle.load(project / "learned.toml").with_limits(speed_m_s=0.5)
    vehicle.save(project / "slow.toml", slow)
    before = (project / "walk.json").read_bytes()
    run("check", project / "walk.json", "--map", pillar_map, "--vehicle", project / "slow.toml", "--renew", code=1)
    assert (project / "walk.json").read_bytes() == before


def test_a_plan_within_limits_of_its_own_is_renewed_within_those_of_the_new_vehicle(project, pillar_map):
    import mapping

    believed = vehicle.load(project / "believed.toml")
    options = planner.PlanOptions(limits=replace(believed.limits, acceleration_m_s2=3.0))
    straight = Waypoints(np.array([[0.8, 0.8, 1.0], [5.2, 0.8, 1.2]]), np.full(2, np.nan))
    plan = planner.plan(straight, mapping.open_map(pillar_map).field, believed, options)
    planner.save_plan(project / "gentle.json", plan, name="gentle")
    vehicle.save(project / "slow.toml", believed.with_limits(speed_m_s=0.5))
    here = ("--map", pillar_map, "--vehicle", project / "slow.toml")
    report = run("check", project / "gentle.json", *here, "--renew", code=1)
    assert [check["name"] for check in report["checks"] if not check["passed"]] == ["speed"]


def test_renewing_a_file_whose_record_was_changed_says_so(project, pillar_map):
    file = project / "walk.json"
    body = json.loads(file.read_text())
    body["check"]["asked"]["margin_m"] = 0.01
    file.write_text(json.dumps(body))
    here = (file, "--map", pillar_map, "--vehicle", project / "believed.toml", "--json")
    assert "fails: record" in goshawk("check", *here).stderr
    assert "was changed since its check" in goshawk("check", *here, "--renew").stderr
    assert "was changed" not in goshawk("check", *here, "--renew").stderr


def test_a_renewed_file_differs_only_in_what_it_was_checked_for(project, pillar_map):
    before = trajectory.load(project / "walk.json")
    run("check", project / "walk.json", "--map", pillar_map, "--vehicle", project / "learned.toml", "--renew")
    after = trajectory.load(project / "walk.json")
    assert after.vehicle_hash == vehicle.vehicle_hash(vehicle.load(project / "learned.toml"))
    same = replace(after, vehicle_hash=before.vehicle_hash, check=before.check)
    assert np.array_equal(same.trajectory.coefficients, before.trajectory.coefficients)
    assert (same.map_hash, same.name) == (before.map_hash, before.name)
