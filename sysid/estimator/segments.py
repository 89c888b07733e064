"""Which segments of long flights are fitted: those that together tell most about the parameters.

A fit takes time and memory in proportion to its nodes, and an hour of flight is mostly hover. So long flights are cut
into segments, and of these the set is chosen, one by one, whose information has the largest determinant (D-optimal
design by the greedy rule: Atkinson, Donev and Tobias, Optimum Experimental Designs, 2007, chapters 10 and 12). What a
segment tells is taken from the model's derivatives along the smoothed pose; the rest is held out.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from flight import FlightLog, Progress, silent
from flight.rotations import IDENTITY, FloatArray
from sysid.estimator.blocks.pose import PoseSensor
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.joint_problem.unknowns import chosen_names
from sysid.estimator.motors import motor
from sysid.estimator.options import Options
from sysid.estimator.trajectory.midpoint import middle
from sysid.estimator.trajectory.model import slopes_along, unexplained
from sysid.estimator.trajectory.states import States, first_guess
from sysid.logs.events.repair import Span
from vehicle import Vehicle, specs

SEGMENT_S = 10.0
"""Long enough for disturbances to be told from forces of the model, short beside a manoeuvre flight."""
USED = 0.4
"""Share of the most nodes that is fitted once there are more: a log a little too long must not become a short one."""
SHORTEST = 0.5
"""A segment at the end of a piece that is shorter than this share of one belongs to the one before."""
LEAST_INFORMATION = 1e-3
"""Of a parameter before any segment, in units of one over its typical size squared."""
UNEXPLAINED_S = 0.1
"""What the model leaves unexplained is taken to last so long."""


def are_long(logs: Sequence[FlightLog], options: Options) -> bool:
    """Whether logs have more nodes than are fitted."""
    return sum(_nodes(log, options) for log in logs) > options.most_nodes


def _nodes(log: FlightLog, options: Options) -> float:
    if len(log) < 2:
        return 0.0
    rate_hz = 1.0 / float(np.median(np.diff(log.time_s)))
    return float(log.time_s[-1] - log.time_s[0]) * min(rate_hz, options.node_rate_hz)


def cut(pieces: Sequence[Span]) -> list[Span]:
    """Pieces of a flight in segments of `SEGMENT_S`, the last one longer or shorter."""
    found: list[Span] = []
    for begin_s, end_s in pieces:
        count = max(1, int((end_s - begin_s) / SEGMENT_S + 1.0 - SHORTEST))
        edges = [begin_s + k * SEGMENT_S for k in range(count)] + [end_s]
        found += pairwise(edges)
    return found


def chosen(flights: Sequence[Flight], vehicle: Vehicle, options: Options, progress: Progress = silent) -> list[Flight]:
    """The segments to fit, in their order; with `options.segments` of "rest", as much of what is held out.

    Each says of its log how much was used, and how it was chosen.
    """
    most = USED * options.most_nodes
    names = chosen_names(vehicle, options.free, options.held, any(f.driven_by_command for f in flights))
    best = _greedy(flights, _information(flights, vehicle, names, progress), most)
    rest = [k for k in range(len(flights)) if k not in best]
    if options.segments == "rest" and rest:
        count = max(1, int(most / np.mean([len(flights[k]) for k in rest])))
        best = rest[:: -(-len(rest) // count)]
    kept = [flights[k] for k in sorted(best)]
    said = _sentence(flights, kept, options)
    return [replace(f, left_out="; ".join(part for part in (f.left_out, said) if part)) for f in kept]


def _sentence(flights: Sequence[Flight], kept: Sequence[Flight], options: Options) -> str:
    whole_s, used_s = (sum(float(f.time_s[-1] - f.time_s[0]) for f in part) for part in (flights, kept))
    use = "were used: they" if options.segments == "most informative" else "are held out and were used; the others"
    return (
        f"{len(kept)} segments of {SEGMENT_S:g} s, {used_s:.0f} of {whole_s:.0f} s, {use} tell most about the "
        "parameters; more with most_nodes"
    )


def _information(flights: Sequence[Flight], vehicle: Vehicle, names: tuple[str, ...], progress: Progress) -> FloatArray:
    """(n, p, p) information of each segment about the parameters, in units of their typical sizes."""
    size = np.array([max(abs(vehicle.value(name)), specs(vehicle)[name].prior) for name in names])
    by_channel, left = np.zeros((len(flights), 6, len(names), len(names))), np.zeros((len(flights), 6))
    for k, flight in enumerate(flights):
        driven, states = motor.driven(flight, vehicle), _states(flight, vehicle)
        slopes = slopes_along(vehicle, names, driven, middle(flight, states)).parameters * size
        by_channel[k] = np.einsum("k,kip,kiq->ipq", flight.step_s, slopes, slopes)
        left[k] = np.square(unexplained(driven, states, vehicle)).mean(axis=0)
        progress("choosing segments", (k + 1) / len(flights))
    density = UNEXPLAINED_S * np.maximum(np.median(left, axis=0), 1e-9)
    return (by_channel / density[:, None, None]).sum(axis=1)


def _states(flight: Flight, vehicle: Vehicle) -> States:
    """From the pose; without one at rest, but for what the gyro shows."""
    if flight.has_pose:
        sensor = PoseSensor.of(vehicle)
        return first_guess(flight, sensor.offset_body_m, sensor.q_body_sensor)
    zero = np.zeros((len(flight), 3))
    return States(zero, zero, np.tile(IDENTITY, (len(flight), 1)), flight.rate_body_rad_s)


def _greedy(flights: Sequence[Flight], information: FloatArray, most: float) -> list[int]:
    """Segments, each the one that adds most to the log determinant of those before, until `most` nodes are reached."""
    total = LEAST_INFORMATION * np.eye(information.shape[1])
    left, found, nodes = list(range(len(flights))), list[int](), 0
    while left and (not found or nodes + len(flights[left[0]]) <= most):
        gains = np.linalg.slogdet(total + information[left])[1]
        best = left.pop(int(np.argmax(gains)))
        found.append(best)
        total = total + information[best]
        nodes += len(flights[best])
    return found
