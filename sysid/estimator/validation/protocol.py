"""Prediction by a stated protocol, as publications give it, always beside models that need no identification.

`h50`: from every instant of a flight, the state as measured, the motion is predicted 0.5 s ahead (50 samples at 100 Hz)
with the rotor speeds of that half second; the error is the mean over all starts of the distance to the measured
position (m), velocity (m/s), attitude (angle, rad) and rate (rad/s). So the nano-drone benchmark of Busetto et al.,
"Nonlinear system identification nano-drone benchmark" (2025), has it.

What a predictor knows is part of its description. Some learn from other flights: each flight is left out of what is
learned for it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flight import FlightLog, InputError, Progress, rotations, silent
from flight.rotations import FloatArray
from sysid.estimator.blocks.pose import PoseSensor
from sysid.estimator.flights.flight_data import Flight, left_out
from sysid.estimator.motors import motor, rotor_speed
from sysid.estimator.options import Options
from sysid.estimator.prepare import gravity_of, prepare, require_pose
from sysid.estimator.trajectory.states import WINDOW_S, States
from sysid.estimator.validation import carried, closed_loop, measured
from sysid.estimator.validation.carried import Disturbance
from sysid.estimator.validation.comparison import QUANTITIES
from sysid.estimator.validation.prediction import Predictor, predict, unexplained
from vehicle import Vehicle

PAST_S = 0.2
"""Predictions start this long after the beginning of a stretch, so that all have some past to know."""


@dataclass(frozen=True, slots=True)
class Protocol:
    """How predictions are judged."""

    name: str
    horizon_s: float


PROTOCOLS = {protocol.name: protocol for protocol in (Protocol("h10", 0.1), Protocol("h50", 0.5))}


@dataclass(frozen=True, slots=True)
class Way:
    """One way to predict, before anything is learned."""

    model: str
    """The vehicle model whose force acts; empty: none."""
    turning: str
    """`held`, `model` or `closed loop`."""
    carried: bool
    """Whether the disturbance just before the start is carried on."""

    @property
    def name(self) -> str:
        """As tables have it."""
        if not self.model:
            return "zero"
        parts = [self.model] + ([] if self.turning == "model" else [TURNING[self.turning]])
        return ", ".join(parts + (["past carried"] if self.carried else []))

    @property
    def learned(self) -> bool:
        """Whether it learns from other flights."""
        return self.carried or self.turning == "closed loop"


TURNING = {"held": "rate held", "model": "moment of the model", "closed loop": "closed loop"}
KNOWS = (
    "zero: velocity and rate held. Rate held: the model's force acts, the rate stays. Model alone: its force and "
    "moment act. Past carried: the disturbance estimated from the past acts too and fades, its time constant "
    "learned from other flights. Closed loop: the body turns as the controller of these flights makes it turn, by a "
    "linear law of rate, tilt and velocity learned from other flights. Rotor speed has no part in it. All "
    "know the measured state at the start and, but for zero, the rotor speeds over the horizon. A velocity or rate "
    "that was not measured comes from fits to the pose that also see a moment after the start; a note names them"
)
ALONE = (
    "past carried and closed loop are left out: what they learn they learn from other flights, and there is only one; "
    "give more flights"
)


def ways(models: Sequence[str]) -> tuple[Way, ...]:
    """Every way that is compared: zero, then those of each model."""
    found = [Way("", "held", False)]
    for model in models:
        found += [Way(model, turning, past) for turning in ("held", "model") for past in (False, True)]
        found.append(Way(model, "closed loop", True))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class Judged:
    """Result of `judge`."""

    protocol: Protocol
    flights: tuple[str, ...]
    starts: tuple[int, ...]
    """Predictions from each flight."""
    errors: Mapping[Way, Mapping[str, tuple[float, ...]]]
    """Way, quantity: mean absolute error on each flight."""
    findings: tuple[str, ...]
    """Sentences on what could not be compared, and on clocks that are not settled."""

    def pooled(self, way: Way) -> dict[str, float]:
        """Mean absolute error over all starts of all flights."""
        return {q: float(np.average(self.errors[way][q], weights=self.starts)) for q in QUANTITIES}

    def as_dict(self) -> dict[str, Any]:
        """The figures as plain JSON values."""
        return {
            "protocol": self.protocol.name,
            "horizon_s": self.protocol.horizon_s,
            "knows": KNOWS,
            "flights": list(self.flights),
            "starts": list(self.starts),
            "findings": list(self.findings),
            "predictors": [
                {
                    "name": way.name,
                    "model": way.model,
                    "turning": way.turning,
                    "past_carried": way.carried,
                    "error_mean": {_key(q): value for q, value in self.pooled(way).items()},
                    "error_mean_by_flight": {_key(q): list(errors[q]) for q in QUANTITIES},
                }
                for way, errors in self.errors.items()
            ],
        }


def _key(quantity: str) -> str:
    return f"{quantity}_{QUANTITIES[quantity].replace('/', '_')}"


@dataclass(frozen=True, slots=True)
class _Stretch:
    """One flight with its states as measured."""

    flight: Flight
    driven: Mapping[str, Flight]
    """Model: the flight with the rotor speeds that drive it, as late as it finds them."""
    states: States
    fitted: tuple[str, ...]
    """Which of velocity and rate were not measured: they come from fits centred on each instant."""

    def driving(self, way: Way) -> Flight:
        """The flight as it drives a predictor."""
        return self.driven.get(way.model, self.flight)


def judge(
    logs: Sequence[FlightLog],
    models: Mapping[str, Vehicle],
    protocol: Protocol,
    options: Options | None = None,
    *,
    training: Sequence[FlightLog] = (),
    progress: Progress = silent,
) -> Judged:
    """Errors of every way to predict, on each flight.

    Args:
        logs: flights to judge on, with a pose.
        training: flights that the disturbance and the closed loop are learned from. Without any, each flight's are
            learned from the others of `logs`; a single log leaves those ways out and says so.

    Raises:
        InputError: no flight, no model, or a log that cannot be used.
    """
    if not logs or not models:
        raise InputError("a protocol needs at least one flight and one model")
    options = options or Options()
    (judged, open_), (taught, more) = (_stretches(part, models, protocol, options) for part in (logs, training))
    others = [[s for log in (taught or judged) if log is not own for s in log] for own in judged]
    compared = [way for way in ways(list(models)) if all(others) or not way.learned]
    errors: dict[Way, dict[str, tuple[float, ...]]] = {}
    for i, way in enumerate(compared):
        found = [e for own, rest in zip(judged, others, strict=True) for e in _errors(own, rest, way, models, protocol)]
        errors[way] = {q: tuple(one[q] for one in found) for q in QUANTITIES}
        progress(f"protocol {protocol.name}", (i + 1) / len(compared))
    flights = [s.flight for own in judged for s in own]
    return Judged(
        protocol,
        tuple(flight.name for flight in flights),
        tuple(len(flight) - _past(flight) - _steps(flight, protocol) for flight in flights),
        errors,
        (() if all(others) else (ALONE,))
        + _seen_ahead([s for own in judged for s in own])
        + left_out(flights)
        + tuple(dict.fromkeys((*open_, *more))),
    )


def _seen_ahead(stretches: Sequence[_Stretch]) -> tuple[str, ...]:
    """The flights whose states at the start know more than the past, a sentence for each quantity not measured."""
    flights: dict[tuple[str, ...], list[str]] = {}
    for s in stretches:
        flights.setdefault(s.fitted, []).append(s.flight.name)
    return tuple(
        f"{' and '.join(fitted)} not measured throughout in {', '.join(names)}, so taken from fits to the pose centred "
        f"on each instant. The state at the start knows up to {0.5 * WINDOW_S:.2f} s of what is predicted, so errors "
        "of every predictor may be too small. What is carried from the past is from before that"
        for fitted, names in flights.items()
        if fitted
    )


def _stretches(
    logs: Sequence[FlightLog], models: Mapping[str, Vehicle], protocol: Protocol, options: Options
) -> tuple[list[list[_Stretch]], tuple[str, ...]]:
    """Of each log, the flights that are long enough, with their states as measured by the first model's clocks; and in
    words, models whose clocks are not settled."""
    if not logs:
        return [], ()
    sensor = PoseSensor.of(next(iter(models.values())))
    least_s = 2.0 * (protocol.horizon_s + closed_loop.LAG_S)
    by_log, gravity_m_s2 = [], gravity_of(models.values())
    for i, log in enumerate(logs):
        flights = prepare(log, i, options, gravity_m_s2=gravity_m_s2)
        by_log.append([flight for flight in flights if flight.time_s[-1] - flight.time_s[0] > least_s])
        require_pose(flights)
        if not by_log[-1]:
            raise InputError(f"flight {i + 1} has no stretch of {least_s:g} s")
    flights = [flight for own in by_log for flight in own]
    found = measured.delays(flights, models, options)

    def stretch(raw: Flight, log: FlightLog) -> _Stretch:
        flight = measured.on_time(raw, found.first)
        driven = {n: motor.driven(rotor_speed.aligned(raw, found.late[n]), model) for n, model in models.items()}
        return _Stretch(flight, driven, measured.states(flight, log, sensor), measured.fitted(flight, log))

    stretches = [[stretch(flight, log) for flight in own] for own, log in zip(by_log, logs, strict=True)]
    return stretches, found.not_converged


def _steps(flight: Flight, protocol: Protocol) -> int:
    return max(1, round(protocol.horizon_s / _step_s(flight)))


def _past(flight: Flight) -> int:
    return round(PAST_S / _step_s(flight))


def _step_s(flight: Flight) -> float:
    return float(np.median(flight.step_s))


def _errors(
    own: Sequence[_Stretch], others: Sequence[_Stretch], way: Way, models: Mapping[str, Vehicle], protocol: Protocol
) -> list[dict[str, float]]:
    """Mean absolute errors on each stretch of one log."""
    predictor = _predictor(way, models, others)
    if not way.carried:
        return [_error(stretch, way, predictor, protocol) for stretch in own]
    fading = _disturbance(way, predictor, others)
    predictor = replace(predictor, lasts_s=fading.lasts_s)
    found = []
    for stretch in own:
        blind_s = 0.5 * WINDOW_S if stretch.fitted else 0.0
        past = fading.just_before(_left(stretch, way, predictor)[0], _step_s(stretch.flight), blind_s)
        states = replace(stretch.states, gust=past)
        found.append(_error(replace(stretch, states=states), way, predictor, protocol))
    return found


def _predictor(way: Way, models: Mapping[str, Vehicle], others: Sequence[_Stretch]) -> Predictor:
    force = models.get(way.model)
    if way.turning == "closed loop":
        return Predictor(force, closed_loop.learn([s.flight for s in others], [s.states for s in others]))
    return Predictor(force, force if way.turning == "model" else None)


def _disturbance(way: Way, predictor: Predictor, others: Sequence[_Stretch]) -> Disturbance:
    left, time_s = zip(*(_left(stretch, way, predictor) for stretch in others), strict=True)
    return carried.learn(left, time_s)


def _left(stretch: _Stretch, way: Way, predictor: Predictor) -> tuple[FloatArray, FloatArray]:
    """(k, 6) unexplained acceleration over each interval, and the middle of each."""
    time_s = stretch.flight.time_s
    return unexplained(stretch.driving(way), stretch.states, predictor), 0.5 * (time_s[1:] + time_s[:-1])


def _error(stretch: _Stretch, way: Way, predictor: Predictor, protocol: Protocol) -> dict[str, float]:
    flight, truth = stretch.driving(way), stretch.states
    predictions = predict(flight, truth, predictor, (protocol.horizon_s,), every_s=0.0)
    kept = slice(_past(flight), None)
    end = truth.picked(predictions.start[kept] + predictions.steps[0])
    reached = predictions.states[0].picked(kept)
    return {
        "position": _mean_distance(reached.position_world_m, end.position_world_m),
        "velocity": _mean_distance(reached.velocity_world_m_s, end.velocity_world_m_s),
        "attitude": float(rotations.angle_between(reached.q_world_body, end.q_world_body).mean()),
        "rate": _mean_distance(reached.rate_body_rad_s, end.rate_body_rad_s),
    }


def _mean_distance(a: FloatArray, b: FloatArray) -> float:
    return float(np.linalg.norm(a - b, axis=1).mean())
