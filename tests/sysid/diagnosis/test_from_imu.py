"""Faults that gyro, accelerometer and commands show without a pose: named and sized, and none where there is none."""

import sys
from pathlib import Path

import numpy as np
import pytest

from flight import FlightLog, InputError
from sysid.diagnosis.findings import Verdict
from sysid.diagnosis.from_imu import diagnose
from sysid.estimator.options import Options

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"
RATE_HZ, DURATION_S = 250.0, 12.0
SOUND, WEAK, UNEQUAL, OFF_CENTRE = range(4)
LOSSES = ((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.05, 0.0), (-0.04, 0.05, 0.0, 0.03), (0.0, 0.0, 0.0, 0.0))
CENTRE_M = ((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.003, -0.001))


@pytest.fixture(scope="module", autouse=True)
def flights():
    sys.path.insert(0, str(BENCHMARKS))
    import without_pose_flights

    yield without_pose_flights
    sys.path.remove(str(BENCHMARKS))


@pytest.fixture(scope="module")
def logs(flights) -> list[FlightLog]:
    """One flight each of a sound vehicle and of three with a fault."""
    rng, body = np.random.default_rng(1), flights.body().with_effect("weak_rotor").with_effect("centre_of_mass")
    values = flights.drawn(len(LOSSES), rng)
    values |= {f"weak_rotor.loss_{i}": np.array([own[i] for own in LOSSES]) for i in range(4)}
    values |= {f"centre_of_mass.{axis}_m": np.array([own[i] for own in CENTRE_M]) for i, axis in enumerate("xy")}
    recorder = flights.Recorder(rate_hz=RATE_HZ)
    return flights.flown(body, values, rng, duration_s=DURATION_S, recorder=recorder)


def test_a_weak_rotor_is_named_with_its_loss(flights, logs):
    found = diagnose([logs[WEAK]], flights.start())
    assert found.additions == ("weak_rotor[2]",)
    (size,) = found.named[0].sizes
    assert size.value == pytest.approx(0.05, abs=0.005)
    assert found.confidence > 0.9
    assert found.vehicle.value("weak_rotor.loss_2") == size.value


def test_unequal_motors_are_one_fault_with_each_rotors_share(flights, logs):
    found = diagnose([logs[UNEQUAL]], flights.start())
    assert found.additions == ("unequal_motors",)
    factor = np.array([1.0 - found.vehicle.value(f"weak_rotor.loss_{i}") for i in range(4)])
    truth = 1.0 - np.array(LOSSES[UNEQUAL])
    assert factor / factor.mean() == pytest.approx(truth / truth.mean(), abs=0.005)
    assert "unequal motors" in found.verdict


def test_a_centre_of_mass_beside_the_hubs_is_named_with_its_place(flights, logs):
    found = diagnose([logs[OFF_CENTRE]], flights.start())
    assert found.additions == ("centre_of_mass",)
    place = [size.value for size in found.named[0].sizes]
    assert place == pytest.approx(CENTRE_M[OFF_CENTRE], abs=2e-4)


def test_a_sound_vehicle_has_no_fault_and_what_needs_the_velocity_is_not_tried(flights, logs):
    found = diagnose([logs[SOUND]], flights.start())
    assert found.additions == found.undecided == ()
    assert found.late_gyro is None
    assert "nothing that an IMU could show" in found.verdict
    unobservable, tried = dict(found.invisible), {one.name for one in found.candidates}
    assert "eRPM" in unobservable["bent_rotor"]
    assert {"parasitic_drag", "inflow_linear", "flapping_moment", "ground_effect", "thrust_bem"} <= {*unobservable}
    assert {"weak_rotor[0]", "centre_of_mass", "products_of_inertia"} <= tried
    weak = next(one for one in found.candidates if one.name == "weak_rotor[1]")
    assert weak.verdict is Verdict.EXCLUDED


def test_a_gyro_that_is_late_is_told_by_the_accelerometers_clock(flights):
    rng = np.random.default_rng(5)
    recorder = flights.Recorder(rate_hz=RATE_HZ, gyro_late_s=4e-3)
    late = flights.flown(flights.body(), flights.drawn(1, rng), rng, duration_s=DURATION_S, recorder=recorder)
    found = diagnose(late, flights.start())
    assert found.late_gyro is not None
    assert "behind the accelerometer" in found.verdict
    assert found.as_dict()["gyro_late_s"]["value"] > 1e-3


def test_no_flight_and_chosen_parameters_are_refused(flights, logs):
    with pytest.raises(InputError, match="at least one log"):
        diagnose([], flights.start())
    with pytest.raises(InputError, match="--hold"):
        diagnose(logs, flights.start(), options=Options(free=("inertia_xx_kg_m2",)))
