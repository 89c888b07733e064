"""Clocks that are off bring no false effects: a late rotor speed is a finding, a late pose is named as such."""

import numpy as np
import pytest

from flight import FlightLog
from sysid import Options
from sysid.diagnosis import diagnose
from sysid.diagnosis.evidence import candidates
from sysid.estimator.flights.sampling import Signal
from sysid.estimator.prepare import prepare
from tests.sysid import flying

SPEED, POSE = "rotor_speed_rad_s", ("position_world", "q_world_body")


def late_rotors(log: FlightLog, delay_s: float, rng: np.random.Generator) -> FlightLog:
    speed = Signal.through(log.time_s, log.vector(SPEED)).value(log.time_s - delay_s)
    noisy = (speed + 4.0 * rng.standard_normal(speed.shape)).T
    columns = {**log.columns, **{f"rotor_speed_{i}_rad_s": row for i, row in enumerate(noisy)}}
    return FlightLog({name: values[4:-4] for name, values in columns.items()}, log.metadata)


def late_pose(log: FlightLog, rows: int) -> FlightLog:
    moved = {n: v[:-rows] if n.startswith(POSE) else v[rows:] for n, v in log.columns.items()}
    return FlightLog(moved, log.metadata)


def flights(seed: int, rotors_late_s: float) -> list[FlightLog]:
    rng = np.random.default_rng(seed)
    exact = flying.fly(
        flying.Truth(gust=0.1, gust_torque=0.3),
        flying.paper_flights(rng, 1, 0.1),
        3,
        duration_s=16.0,
        rng=rng,
        rotor_noise_rad_s=0.0,
        gyro_noise_rad_s=0.01,
    )
    return [late_rotors(log, rotors_late_s, rng) for log in exact]


@pytest.mark.parametrize(("clock", "named"), [("pose", False), ("rotor speed", True)])
def test_a_late_pose_is_a_candidate_only_where_the_other_clocks_are_not_estimated_against_it(
    campaign, truth, clock, named
):
    lined = candidates.candidate_set(truth, prepare(campaign[2], 0, Options()), clock)
    assert ("pose_delay" in {s.name for s in lined.candidates}) is named
    assert ("pose_delay" in {name for name, _ in lined.invisible}) is not named


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "late_s"), [(1, 0.005), (2, -0.008), (3, 0.002)])
def test_rotor_speed_that_is_late_or_early_brings_no_false_effect(truth, seed, late_s):
    found = diagnose(flights(seed, late_s), truth, auto=True)
    assert found.additions == ()
    assert found.outside is None
    delays = [c for c in found.search.models[-1].fit.clocks if c.stream == "rotor speed"]
    assert all(abs(c.delay_s - late_s) < max(3e-4, 3.0 * c.std_robust) for c in delays)


@pytest.mark.slow
def test_a_pose_that_is_late_against_all_others_is_named(truth):
    found = diagnose([late_pose(log, 2) for log in flights(4, 0.0)], truth, auto=True)
    assert found.additions == ("pose_delay",)
    assert found.vehicle.value("pose_delay.delay_s") == pytest.approx(0.01, abs=5e-4)
