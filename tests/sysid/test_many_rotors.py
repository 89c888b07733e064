"""A simulated hexarotor from plan to diagnosis: what the file has wrong is learnt, and its weak rotor is named."""

from dataclasses import replace

import numpy as np
import pytest

import planner
import sysid
from esdf import solids
from flight import FlightLog, Trajectory, Waypoints
from sysid.diagnosis import procedure
from sysid.diagnosis.evidence import free_form
from tests.vehicle import frames
from vehicle import Vehicle, draft, flights, manoeuvres, simulate
from vehicle.simulation.tracking import Tracker

STEP_S = 0.005
WRONG = {
    "inertia_xx_kg_m2": 1.25,
    "inertia_zz_kg_m2": 0.85,
    "thrust_quadratic.k_n_s2": 1.08,
    "rotor_yaw_torque.torque_n_m_s2": 1.2,
}
"""What the vehicle has more of than its file says, as a factor."""
WEAK = 4


def believed() -> Vehicle:
    known = frames.small("hex", rotor_speed_max_rad_s=900.0)
    return draft.draft(known).with_effect("rotor_drag_speed", drag_kg=1e-4)


def true_one(drone: Vehicle) -> Vehicle:
    for name, factor in WRONG.items():
        drone = drone.with_value(name, factor * drone.value(name))
    return drone


def planned(drone: Vehicle) -> Trajectory:
    """As the planner makes and the gate passes it."""
    sky = solids.Scene([solids.Sphere((1000.0, 0.0, 0.0), 1.0)])
    way = np.array([[0.0, 0.0, 1.5], [4.0, 0.0, 2.5], [4.0, 4.0, 1.5], [0.0, 4.0, 2.5], [0.0, 0.0, 1.5]])
    plan = planner.plan(Waypoints(way, np.full(5, np.nan)), sky, drone)
    assert plan.gate.passed
    return plan.trajectory


def flown(truth: Vehicle, file: Vehicle) -> list[FlightLog]:
    """Simulated flights along a plan and two manoeuvres, as its sensors tell them."""
    rng, logs = np.random.default_rng(3), []
    for name, path in (("plan", planned(file)), *((n, manoeuvres.make(n)) for n in ("oblique", "yaw_sweep"))):
        start = path.evaluate(np.zeros(1))[0]
        state = simulate.hovering(file, start[:3], yaw_rad=float(start[3]))
        fleet = simulate.Fleet(truth, [state], step_s=STEP_S)
        ride = flights.fly(fleet, Tracker(file, path, STEP_S), min(path.duration_s, 12.0), period_s=STEP_S)
        log = flights.measure(ride, rng=rng)
        logs.append(replace(log, metadata={**log.metadata, "name": name}))
    return logs


@pytest.mark.parametrize("frame", ["x", "hex", "octo"])
def test_curves_are_asked_of_the_rotors_that_there_are(frame):
    hubs, spin = draft.layout(0.16, frame)
    drone = replace(believed(), hub_body_m=hubs, spin=spin)
    single = [name for name in free_form.channels_of(drone) if name in free_form.ROTORS]
    assert single == [f"T_{i}" for i in range(drone.rotors)]
    assert len(free_form.losses(drone)) == drone.rotors


@pytest.mark.slow
def test_what_the_file_has_wrong_is_learnt_to_a_few_per_cent():
    file = believed()
    truth = true_one(file)
    found = sysid.identify(flown(truth, file), file).vehicle
    for name in WRONG:
        assert found.value(name) == pytest.approx(truth.value(name), rel=0.03)


@pytest.mark.slow
def test_the_weak_rotor_of_six_is_named():
    file = believed()
    truth = true_one(file).with_effect("weak_rotor", **{f"loss_{WEAK}": 0.06})
    found = procedure.diagnose(flown(truth, file), file)
    assert found.additions == (f"weak_rotor[{WEAK}]",)
    assert found.vehicle.value(f"weak_rotor.loss_{WEAK}") == pytest.approx(0.06, abs=0.01)
