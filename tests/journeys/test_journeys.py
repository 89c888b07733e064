"""Journeys of new users, typed as the documentation tells them: from files to a result in at most ten commands."""

import contextlib
import csv
import gzip
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import mapping
import sysid
import vehicle
from flight import FlightLog, flight_log, trajectory
from sysid.estimator.validation.comparison import HORIZONS_S, QUANTITIES
from sysid.estimator.validation.protocol import PROTOCOLS
from tests.journeys import inputs
from vehicle.forces import open_air

PORT = "14561"
"""What the journeys write; a test takes a free one instead."""
HERE = Path(__file__).parent
ROOT = HERE.parent.parent
SCRIPTS = sorted(HERE.glob("*.sh"))
REAL = ROOT.parent / "shared" / "data" / "flight" / "nanodrone_cf21bl" / "square_20251017_run2.csv.gz"


def walk(name: str, folder: Path, *, timeout_s: float = 900.0) -> str:
    """Type a journey's lines in `folder`; all they print. What they left running ends with them."""
    lines = (HERE / f"{name}.sh").read_text().replace(PORT, str(free_port()))
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    with open(folder / "out.txt", "w") as out, open(folder / "err.txt", "w") as err:
        shell = subprocess.Popen(
            ["bash", "-e", "-c", lines],
            cwd=folder, env=os.environ | {"PATH": programs}, stdout=out, stderr=err, start_new_session=True,
        )  # fmt: skip
        try:
            code = shell.wait(timeout=timeout_s)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(shell.pid, signal.SIGKILL)
    said, errors = (folder / "out.txt").read_text(), (folder / "err.txt").read_text()
    assert code == 0, said[-3000:] + errors[-3000:]
    assert "Traceback" not in errors
    assert "Warning" not in errors
    return said


def free_port() -> int:
    """A UDP port that nobody listens at now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def commands(script: Path) -> list[str]:
    return [line for line in script.read_text().splitlines() if line and not line.startswith("#")]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_journey_has_at_most_ten_commands_and_stands_in_the_documentation(script):
    assert 1 <= len(commands(script)) <= 10
    told = "".join((ROOT / "docs" / "start" / page).read_text() for page in ("journeys.md", "learn_from_a_log.md"))
    assert f"{{literalinclude}} ../../tests/journeys/{script.name}\n" in told


@pytest.mark.slow
def test_a_data_sheet_becomes_a_checked_plan(tmp_path, pillar_map):
    inputs.with_room(tmp_path, pillar_map)
    walk("own_vehicle", tmp_path)
    planned = trajectory.load(tmp_path / "my-room" / "trajectories" / "first.json")
    assert planned.check["passed"]


@pytest.mark.slow
def test_a_foreign_csv_becomes_a_fitted_vehicle(tmp_path):
    log = inputs.with_foreign_csv(tmp_path)
    said = walk("foreign_csv", tmp_path)
    assert "shifted the time stamps of rotor_speed_0_rad_s" in said
    mended = flight_log.load(tmp_path / "flight.parquet")
    position = mended.vector("position_world_m")
    np.testing.assert_allclose(position, log.vector("position_world_m")[: len(position)], atol=1e-6)
    fitted, truth = vehicle.load(tmp_path / "fitted.toml"), inputs.truth()
    for axis in ("xx", "yy"):
        found = fitted.parameter(f"inertia_{axis}_kg_m2")
        assert abs(found.value - truth.value(f"inertia_{axis}_kg_m2")) < 4.0 * found.std
    assert (tmp_path / "after.html").stat().st_size > 50_000


def with_real_csv(folder: Path) -> None:
    """A real flight, the rotor clock made 40 ms late, time in ms, gyro in degrees, rotors in rpm; units unsaid."""
    with gzip.open(REAL, "rt") as file:
        rows = [row for row in csv.DictReader(file) if row["is_flying"] == "1"]
    time_s = np.array([float(row["t_s"]) for row in rows])

    def of(*names: str) -> np.ndarray:
        return np.array([[float(row[name]) for name in names] for row in rows])

    speeds = of(*(f"mot{i}_radps" for i in range(1, 5))) * 30.0 / np.pi
    late = np.stack([np.interp(time_s - 0.04, time_s, column) for column in speeds.T], axis=1)
    parts = [1000.0 * time_s[:, None], of("x_m", "y_m", "z_m"), of("qx", "qy", "qz", "qw")]
    parts += [np.rad2deg(of("wx_radps", "wy_radps", "wz_radps")), late]
    lines = [
        "stamp;x;y;z;qx;qy;qz;qw;gyro_x;gyro_y;gyro_z;m1;m2;m3;m4",
        *(";".join(f"{v:.9g}" for v in row) for row in np.hstack(parts)),
    ]
    (folder / "flight.csv").write_text("\n".join(lines))


@pytest.mark.slow
@pytest.mark.skipif(not REAL.exists(), reason="the real flights are not beside this repository (../shared/data/flight)")
def test_a_real_csv_with_wrong_units_and_clocks_is_corrected(tmp_path):
    with_real_csv(tmp_path)
    walk("real_csv", tmp_path)
    mended = flight_log.load(tmp_path / "flight.parquet")
    assert 1500.0 < np.nanmedian(mended.vector("rotor_speed_rad_s")) < 2300.0
    assert np.nanstd(mended.vector("rate_body_rad_s")) < 5.0
    assert any("rotor_speed" in done and "shifted" in done for done in mended.metadata["fixes"])


@pytest.mark.slow
@pytest.mark.skipif(not REAL.exists(), reason="the real flights are not beside this repository (../shared/data/flight)")
def test_a_real_csv_whose_gyro_clock_is_unsure_is_put_in_order_and_not_shifted(tmp_path):
    """As its source publishes it; 65 s of random way-points."""
    with gzip.open(REAL.with_name("random1_20251017_run1.csv.gz"), "rt") as file:
        (tmp_path / "flight.csv").write_text(file.read())
    said = walk("real_csv", tmp_path)
    clock = re.search(r"Compared plainly it is ([\d.]+) ± ([\d.]+) ms early", said)
    assert clock is not None
    early_ms, std_ms = map(float, clock.groups())
    # The same data: processors only round differently, far below the standard error.
    assert early_ms == pytest.approx(8.7, abs=0.5 * std_ms)
    assert std_ms == pytest.approx(0.5, abs=0.15)
    (done,) = flight_log.load(tmp_path / "flight.parquet").metadata["fixes"]
    assert "took columns [3, 2, 1, 0] of rotor speed" in done


@pytest.mark.slow
@pytest.mark.skipif(not REAL.exists(), reason="the real flights are not beside this repository (../shared/data/flight)")
def test_a_real_csv_becomes_a_vehicle_that_predicts_another_flight_better(tmp_path):
    for name, of, part in (("flight", 1, slice(1, 4001)), ("other", 2, slice(1000, 4000))):
        with gzip.open(REAL.with_name(f"random1_20251017_run{of}.csv.gz"), "rt") as file:
            heads, *rows = file.readlines()
        (tmp_path / f"{name}.csv").write_text("".join([heads, *rows[part]]))
    walk("real_csv_better", tmp_path)
    models = {name: vehicle.load(tmp_path / f"{name}.toml") for name in ("nano", "better")}
    assert "wake_skew_moment" in models["better"].effects
    held_out = [flight_log.load(tmp_path / "other.parquet")]
    wrench = sysid.wrench_errors(held_out, models).rmse
    for part in (slice(0, 3), slice(3, 6)):  # force, moment
        assert np.linalg.norm(wrench["better"][part]) < 0.7 * np.linalg.norm(wrench["nano"][part])
    judged = sysid.judge(held_out, models, PROTOCOLS["h50"])
    alone = {way.model: judged.pooled(way) for way in judged.errors if way.turning == "model" and not way.carried}
    for quantity in QUANTITIES:
        assert alone["better"][quantity] < 0.5 * alone["nano"][quantity]


@pytest.mark.slow
def test_photographs_with_an_unknown_lens_become_a_map(tmp_path):
    inputs.with_photographs(tmp_path)
    walk("own_photographs", tmp_path)
    area = mapping.open_map(tmp_path / "my-room" / "map")
    assert len(area.images) >= 0.8 * inputs.PHOTO_COUNT
    camera = mapping.rig.load(tmp_path / "camera.toml").cameras[0]
    axis = np.array([np.sin(0.5), 0.0, np.cos(0.5)])
    assert camera.project(axis)[0] - 160.0 == pytest.approx(228.5 * np.tan(0.5), abs=3.0)


@pytest.mark.slow
def test_own_waypoints_become_a_flown_log(tmp_path, pillar_map):
    inputs.with_room(tmp_path, pillar_map)
    inputs.with_vehicle(tmp_path)
    walk("own_waypoints", tmp_path)
    flown = flight_log.load(tmp_path / "lap.parquet")
    gap_m = np.linalg.norm(flown.vector("position_world_m") - [5.2, 3.2, 1.2], axis=1)
    assert np.nanmin(gap_m) < 0.3
    assert (tmp_path / "lap.html").exists()


SD_CARD = ROOT.parent / "shared" / "data" / "flight" / "crazyflie_motor_lag_arpl"
PUBLISHED_INERTIA_KG_M2 = {"xx": 1.03e-5, "yy": 1.105e-5}
PUBLISHED_THRUST_N = {0.5: 0.0457, 0.7: 0.0723}
"""Of one rotor by command (Eschmann, Albani and Loianno 2024: .0213 - .0112 u + .1201 u^2)."""


@pytest.mark.slow
@pytest.mark.skipif(
    not SD_CARD.exists(), reason="the real flights are not beside this repository (../shared/data/flight)"
)
def test_logs_of_a_real_crazyflies_sd_card_become_the_published_vehicle(tmp_path):
    for log, name in (("log10", "throttle"), ("log15", "turns")):
        (tmp_path / name).write_bytes((SD_CARD / log).read_bytes())
    walk("crazyflie_sd_card", tmp_path)
    fitted = vehicle.load(tmp_path / "fitted.toml")
    for axis, published in PUBLISHED_INERTIA_KG_M2.items():
        found = fitted.parameter(f"inertia_{axis}_kg_m2")
        assert abs(found.value - published) < 2.0 * found.std
        assert found.std < 0.15 * published
    for command, published in PUBLISHED_THRUST_N.items():
        speed = np.full((1, 4), command * fitted.limits.rotor_speed_max_rad_s)
        thrust = vehicle.wrench(fitted, np.zeros((1, 3)), np.zeros((1, 3)), speed, open_air(1))[0][0, 2] / 4.0
        assert thrust == pytest.approx(published, rel=0.05)
    for side in ("rise", "fall"):
        assert 0.04 < fitted.value(f"motor_lag.{side}_s") < 0.11


LEARNING = {
    # journey: what is there before it, and which of our rotors its vehicle file counts first, second ...
    "px4_log": (inputs.with_ulog, inputs.PX4_ORDER),
    "ardupilot_log": (inputs.with_dataflash, (0, 1, 2, 3)),
    "ros_recording": (inputs.with_recording, (0, 1, 2, 3)),
    "crazyflie_csv": (inputs.with_crazyflie, (0, 1, 2, 3)),
    "own_telemetry": (inputs.with_own_telemetry, (0, 1, 2, 3)),
}


@pytest.mark.parametrize("journey", [*LEARNING, "real_csv_better"])
def test_from_a_log_to_a_better_vehicle_are_at_most_six_commands(journey):
    assert len(commands(HERE / f"{journey}.sh")) <= 6


@pytest.mark.slow
@pytest.mark.parametrize("journey", LEARNING)
def test_a_log_of_any_kind_becomes_a_vehicle_that_predicts_another_flight(journey, tmp_path):
    prepare, order = LEARNING[journey]
    prepare(tmp_path)
    said = walk(journey, tmp_path)
    assert "missing was rotor_drag_thrust (" in said
    given, better = (vehicle.load(tmp_path / name) for name in ("quad.toml", "better.toml"))
    truth = inputs.dragged()
    np.testing.assert_allclose(better.hub_body_m, truth.hub_body_m[list(order)], atol=1e-6)
    assert (better.spin == truth.spin[list(order)]).all()
    assert better.value("rotor_drag_thrust.drag_s_m") == pytest.approx(0.03, rel=0.05)
    columns = dict(inputs.other_flight().columns)
    columns |= {
        f"rotor_speed_{i}_rad_s": inputs.other_flight().columns[f"rotor_speed_{k}_rad_s"] for i, k in enumerate(order)
    }
    judged = sysid.compare([FlightLog(columns, {})], {"given": given, "better": better})
    after = HORIZONS_S.index(0.5)
    assert judged.errors["better"]["position"][after] < 0.1 * judged.errors["given"]["position"][after]
