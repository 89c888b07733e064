"""Each foreign format is read back by an evaluator written here, from the format's description alone."""

import csv
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from ruamel.yaml import YAML

import planner
import vehicle
from esdf import solids
from flight import InputError, Trajectory, Waypoints, trajectory
from goshawk.commands.plan import formats
from planner.gate import gate, plan_report
from tests.goshawk.running import answer as goshawk

SCENE = solids.Scene([solids.Room((-8.0, -8.0, 0.0), (8.0, 8.0, 3.0)), solids.Cylinder((0.0, 0.0, 1.5), 0.6, 3.0)])


@pytest.fixture(scope="module")
def drone() -> vehicle.Vehicle:
    return vehicle.example("rigter2019")


@pytest.fixture(scope="module")
def plan(drone) -> planner.Plan:
    points = np.array([[-4.0, 0.0, 1.0], [0.0, 3.0, 1.5], [4.0, 0.1, 1.0]])
    return planner.plan(Waypoints(points, np.full(3, np.nan)), SCENE, drone)


def evaluate(durations: list[float], pieces: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Piecewise polynomials (k, axes, n), ascending powers of the time since the piece began."""
    found, ends = [], np.cumsum(durations)
    for t in times:
        i = min(int(np.searchsorted(ends, t)), len(durations) - 1)
        since = t - (ends[i] - durations[i])
        found.append([sum(c * since**n for n, c in enumerate(axis)) for axis in pieces[i]])
    return np.array(found)


def test_crazyflie_poly4d_flies_the_same_path(plan, tmp_path):
    formats.write_crazyflie(tmp_path / "p.csv", plan.trajectory)
    rows = list(csv.reader((tmp_path / "p.csv").read_text().splitlines()))
    assert rows[0][:3] == ["Duration", "x^0", "x^1"]
    assert rows[0][-1] == "yaw^7"
    numbers = np.array([[float(cell) for cell in row] for row in rows[1:]])
    assert numbers.shape[1] == 33
    times = plan.trajectory.sample(0.05)
    flown = evaluate(numbers[:, 0].tolist(), numbers[:, 1:].reshape(-1, 4, 8), times)
    assert np.abs(flown - plan.trajectory.evaluate(times)).max() < 1e-9


def test_a_piece_with_more_terms_than_poly4d_holds_is_fitted_anew(tmp_path):
    nine = Trajectory(np.ones(1), 0.1 * np.ones((1, 4, 9)))
    held = formats.write_crazyflie(tmp_path / "p.csv", nine)
    assert held.trajectory.coefficients.shape[2] == 8
    assert held.largest_m < 1e-4


def test_mav_trajectory_generation_flies_the_same_path(plan, tmp_path):
    formats.write_mav_trajectory_generation(tmp_path / "p.yaml", plan.trajectory)
    segments = YAML(typ="safe").load(tmp_path / "p.yaml")["segments"]
    assert all(s["N"] == 8 and s["D"] == 4 and isinstance(s["time"], int) for s in segments)
    durations = [1e-9 * s["time"] for s in segments]
    times = plan.trajectory.sample(0.05)[:-1]
    flown = evaluate(durations, np.array([s["coefficients"] for s in segments], dtype=float), times)
    assert np.abs(flown - plan.trajectory.evaluate(times)).max() < 1e-6  # durations in whole nanoseconds


def test_a_step_that_makes_millions_of_setpoints_is_refused(plan, tmp_path):
    with pytest.raises(InputError, match=r"makes .* setpoints; at most 1000000 .* take .* s or more"):
        formats.write_px4(tmp_path / "p.csv", plan.trajectory, 1e-9)
    assert not (tmp_path / "p.csv").exists()


def test_px4_setpoints_are_the_path_in_ned(plan, tmp_path):
    formats.write_px4(tmp_path / "p.csv", plan.trajectory, 0.005)
    rows = list(csv.DictReader((tmp_path / "p.csv").read_text().splitlines()))
    values = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    t = values["t_s"]
    assert np.diff(t).max() <= 0.005 + 1e-12
    assert t[-1] == pytest.approx(plan.trajectory.duration_s)
    position = np.stack([values["position_x"], -values["position_y"], -values["position_z"]], axis=1)
    assert np.abs(position - plan.trajectory.position(t)).max() < 1e-12
    for upper, lower in (("velocity", "position"), ("acceleration", "velocity"), ("jerk", "acceleration")):
        for axis in "xyz":
            slope = np.gradient(values[f"{lower}_{axis}"], t)[2:-2]
            given = values[f"{upper}_{axis}"][2:-2]
            assert np.abs(slope - given).max() < 0.02 * (1.0 + np.abs(given).max())
    turned = np.angle(np.exp(1j * (values["yaw"] + plan.trajectory.evaluate(t)[:, 3])))
    assert np.abs(turned).max() < 1e-9


class Loads(HTMLParser):
    """Everything a page would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.found += [value for name, value in attrs if name in ("src", "href") and value]


def test_the_report_is_one_offline_page_with_the_binding_limits(plan, drone):
    item = planner.trajectory_file(plan, name="<b>round")
    report = gate.check_file(item, SCENE, drone)
    text = plan_report.page(item, report, SCENE, drone, planner.PlanOptions().limits_for(drone))
    loads = Loads()
    loads.feed(text)
    assert not loads.found
    assert "url(" not in text
    assert "default-src 'none'" in text  # nor may it, wherever it is opened
    assert "<b>round" not in text
    for word in ("passes the gate", "Clearance, m", "Speed, m/s", "Tilt, °", "Rotor speed, rad/s"):
        assert word in text
    assert set(filter(None, report.binding)) <= set(re.findall(r"<td>([a-z ]+)</td></tr>", text))
    assert text.count("<tr><td class") == len(plan.trajectory.durations_s)
    assert not re.search(r"\de\+\d", text)  # rotor speeds have four digits, and no power of ten


@pytest.mark.parametrize(
    "fault", [("--px4", "c.csv", "--step", "nan"), ("--report", "r.html", "--map", "none", "--vehicle", "none.toml")]
)
def test_a_fault_of_one_result_leaves_none_of_the_others(plan, tmp_path, monkeypatch, fault):
    monkeypatch.chdir(tmp_path)
    planner.save_plan(tmp_path / "lap.json", plan, name="lap")
    assert goshawk("export", "lap.json", "--crazyflie", "a.csv", *fault).returncode == 2
    assert [path.name for path in tmp_path.iterdir()] == ["lap.json"]


def test_the_verb_writes_every_format_and_refuses_what_was_not_checked(plan, tmp_path):
    planner.save_plan(tmp_path / "lap.json", plan, name="lap")
    out = ("--crazyflie", tmp_path / "a.csv", "--mav-trajectory", tmp_path / "b.yaml", "--px4", tmp_path / "c.csv")
    written = goshawk("export", tmp_path / "lap.json", *out, "--json")
    assert written.returncode == 0
    facts = json.loads(written.stdout)
    assert facts["crazyflie_pieces"] == len(plan.trajectory.durations_s)
    assert 0.0 < facts["crazyflie_from_plan_m"] < 1e-4  # single precision
    assert all((tmp_path / name).is_file() for name in ("a.csv", "b.yaml", "c.csv"))
    assert "exists; give another name" in goshawk("export", tmp_path / "lap.json", *out).stderr
    assert goshawk("export", tmp_path / "lap.json").returncode == 2
    assert "needs --map" in goshawk("export", tmp_path / "lap.json", "--report", tmp_path / "r.html").stderr
    item = trajectory.load(tmp_path / "lap.json")
    unchecked = trajectory.TrajectoryFile(item.trajectory, "x", "", "", item.waypoints_world_m, {})
    trajectory.save(tmp_path / "raw.json", unchecked)
    refused = goshawk("export", tmp_path / "raw.json", "--crazyflie", tmp_path / "d.csv")
    assert refused.returncode == 2
    assert "has not passed the gate" in refused.stderr
    bent = trajectory.load(tmp_path / "lap.json")
    bent.trajectory.coefficients[0, 2, 0] -= 5.0
    trajectory.save(tmp_path / "bent.json", bent)
    refused = goshawk("export", tmp_path / "bent.json", "--px4", tmp_path / "e.csv")
    assert refused.returncode == 2
    assert "was changed after its check" in refused.stderr
