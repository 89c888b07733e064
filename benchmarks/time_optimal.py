"""Time-optimal flight through gates by direct transcription (CasADi, IPOPT), beside the planner: equal limits.

The reference chooses snap freely, constant over each of many short intervals, and the time of each leg; position and
yaw are then exact polynomials. At every node it keeps the same limits that the planner's optimiser keeps: speed,
acceleration, tilt, rates and four rotors of the reduced vehicle with its drag (`planner.optimise.airframe`), written
down once more. It knows no price on snap, no minimum-snap spline and no gate.
"""

import itertools
import time
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import planner_scenes
import report

import planner
import vehicle
from esdf import solids
from flight import FloatArray, Waypoints
from flight.frames import GRAVITY_M_S2
from planner.curve import minimum_snap
from planner.optimise import airframe, repair

SKY = solids.Scene([solids.Sphere((1000.0, 0.0, 0.0), 1.0)])
INTERVALS = 12
"""Of constant snap in each leg."""


@dataclass(frozen=True)
class Answer:
    """What the reference found."""

    duration_s: float
    cpu_s: float
    finished: bool


def rows(gates: tuple[int, ...] = (5, 7, 10)) -> list[report.Row]:
    found, options = [], planner.PlanOptions(control_reserve=0.0, yaw="free")
    for (name, drone), count in itertools.product(planner_scenes.vehicles().items(), gates):
        points = walk(count, count)
        asked = Waypoints(points, np.full(count, np.nan))
        begun = time.process_time()
        plan = planner.plan(asked, SKY, drone, options)
        cpu_s = time.process_time() - begun
        reference = solve(points, airframe.reduced(drone, options.limits_for(drone)), drone)
        longer = plan.trajectory.duration_s / reference.duration_s
        peers = {
            "reference s": reference.duration_s,
            "finished": float(reference.finished),
        }
        title = f"{name}, {count} gates: flight over the optimum"
        found.append(report.row(title, longer, "x", "< 1.08", longer < 1.08, peers))
        cheaper, seconds = reference.cpu_s / cpu_s, {"ours CPU s": cpu_s, "reference CPU s": reference.cpu_s}
        found.append(report.row("  CPU of the reference over ours", cheaper, "x", "> 10", cheaper > 10, seconds))
    return found


def walk(count: int, seed: int) -> FloatArray:
    return np.cumsum(np.random.default_rng(seed).normal(size=(count, 3)) * [3.0, 3.0, 0.7], axis=0)


def solve(points: FloatArray, frame: airframe.Airframe, drone: vehicle.Vehicle) -> Answer:
    """Least time through the points (k + 1, 3), at rest at both ends; begun from a slow minimum-snap flight."""
    legs = len(points) - 1
    start = _slow(points, drone)
    problem = ca.Opti()
    T = problem.variable(legs)
    nodes = [problem.variable(4, 4) for _ in range(legs * INTERVALS + 1)]  # rows: x y z yaw; columns: derivatives 0-3
    snaps = [problem.variable(4) for _ in range(legs * INTERVALS)]
    over = _excess(frame)
    problem.minimize(ca.sum1(T))
    problem.subject_to(T >= 0.1)
    for i, node in enumerate(nodes):
        leg = min(i // INTERVALS, legs - 1)
        if i % INTERVALS == 0:
            problem.subject_to(node[:3, 0] == points[i // INTERVALS])
        if i < len(snaps):
            problem.subject_to(nodes[i + 1] == _advanced(node, snaps[i], T[leg] / INTERVALS))
            problem.subject_to(over(node, snaps[i]) <= 0.0)
        if i > 0:  # snap, and with it the torque, jumps at a node: both sides must be flyable
            problem.subject_to(over(node, snaps[i - 1]) <= 0.0)
        at = start.starts_s[leg] + start.durations_s[leg] * (i - leg * INTERVALS) / INTERVALS
        jet = [start.evaluate(np.array([min(at, start.duration_s)]), r)[0] for r in range(5)]
        problem.set_initial(node, np.stack(jet[:4], axis=1))
        if i < len(snaps):
            problem.set_initial(snaps[i], jet[4])
    for node in (nodes[0], nodes[-1]):
        problem.subject_to(node[:, 1:] == 0.0)
    problem.set_initial(T, start.durations_s)
    problem.solver("ipopt", {"print_time": False, "expand": True}, {"print_level": 0, "sb": "yes", "max_iter": 1500})
    begun = time.process_time()
    try:
        found = problem.solve()
        finished = True
    except RuntimeError:  # the iterations were used up
        found, finished = problem.debug, False
    return Answer(float(np.sum(found.value(T))), time.process_time() - begun, finished)


def _slow(points: FloatArray, drone: vehicle.Vehicle) -> planner.planning.Trajectory:
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    path = minimum_snap.trajectory(minimum_snap.solve(points, np.maximum(lengths, 1.0)))
    return path.scale_time(1.2 * repair.time_scale(path, drone, drone.limits))


def _advanced(jet: ca.MX, snap: ca.MX, h: ca.MX) -> ca.MX:
    """The four derivatives (4, 4) after h seconds of constant snap."""
    p, v, a, j = (jet[:, r] for r in range(4))
    return ca.horzcat(
        p + h * v + h**2 / 2 * a + h**3 / 6 * j + h**4 / 24 * snap,
        v + h * a + h**2 / 2 * j + h**3 / 6 * snap,
        a + h * j + h**2 / 2 * snap,
        j + h * snap,
    )


def _excess(w: airframe.Airframe) -> ca.Function:
    """Relative excess over the 14 limits; see `planner.optimise.airframe.excess_numpy`, whose formulas these are."""
    jet, snap = ca.SX.sym("jet", 4, 4), ca.SX.sym("snap", 4)
    v, a, j, s = jet[:3, 1], jet[:3, 2], jet[:3, 3], snap[:3]
    yaw, yaw_rate, yaw_acceleration = jet[3, 0], jet[3, 1], jet[3, 2]
    f = a + ca.vertcat(0, 0, GRAVITY_M_S2)
    force, pace = ca.sqrt(ca.sumsqr(f) + 1e-6), ca.sqrt(ca.sumsqr(v) + 1e-2)
    drag = w.drag_per_thrust_1_s * force / GRAVITY_M_S2 + w.drag_per_speed_1_m * pace
    thrust, thrust_1, thrust_2 = f + drag * v, j + drag * a, s + drag * j
    size = ca.sqrt(ca.fmax(ca.sumsqr(thrust), 0.04 * GRAVITY_M_S2**2))
    z = thrust / size
    change = ca.dot(z, thrust_1)
    z_1 = (thrust_1 - z * change) / size
    z_2 = (thrust_2 - z * ca.dot(z, thrust_2) - 2.0 * change * z_1) / size
    low = ca.fmax(1.0 + z[2], 0.1)
    flat_1, flat_2 = ((d - z * d[2] / low)[:2] for d in (z_1, z_2))
    forward, left = ca.vertcat(ca.cos(yaw), ca.sin(yaw)), ca.vertcat(-ca.sin(yaw), ca.cos(yaw))
    spin_1, spin_2 = (z[0] * d[1] - z[1] * d[0] for d in (z_1, z_2))
    rate = ca.vertcat(-ca.dot(left, flat_1), ca.dot(forward, flat_1), yaw_rate - spin_1 / low)
    turn = ca.vertcat(
        -ca.dot(left, flat_2) + rate[1] * rate[2],
        ca.dot(forward, flat_2) - rate[0] * rate[2],
        yaw_acceleration - spin_2 / low + spin_1 * z_1[2] / low**2,
    )
    torque = turn * w.inertia_kg_m2 + ca.cross(rate, rate * w.inertia_kg_m2)
    climb = ca.dot(v, z)
    lift = w.lift_axial_1_s * climb + w.lift_lateral_1_m * (ca.sumsqr(v) - climb**2)
    effort = w.effort_hover + w.mix @ ca.vertcat(ca.dot(f, z) - lift - GRAVITY_M_S2, torque)
    over = ca.vertcat(
        ca.sumsqr(v) / w.speed_m_s**2 - 1.0,
        ca.sumsqr(a) / w.acceleration_m_s2**2 - 1.0,
        ca.sumsqr(j) / w.jerk_m_s3**2 - 1.0,
        (w.cos_tilt - z[2]) / (1.0 - w.cos_tilt),
        ca.sumsqr(z_1) / w.rate_rad_s**2 - 1.0,
        rate[2] ** 2 / w.yaw_rate_rad_s**2 - 1.0,
        effort - w.effort_most,
        w.effort_least - effort,
    )
    return ca.Function("excess", [jet, snap], [over])


def agree() -> float:
    """Largest difference between these formulas and the planner's own, at random motions."""
    drone = vehicle.example("rigter2019")
    frame = airframe.reduced(drone, replace(drone.limits, speed_m_s=4.0))
    over, worst = _excess(frame), 0.0
    for motion in np.random.default_rng(0).normal(size=(50, 5, 4)):
        ours = airframe.excess_numpy(frame, motion[None])[0]
        worst = max(worst, float(np.abs(np.array(over(motion[:4].T, motion[4])).ravel() - ours).max()))
    return worst


if __name__ == "__main__":
    assert agree() < 1e-9
    report.main(rows)
