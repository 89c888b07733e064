"""Clocks: how late each stream of a log is, estimated in every fit as the gyro's bias is.

Only differences of clocks show, so one stream is the reference: the pose, or where there is none the IMU. The pose
itself may be late by the vehicle's effect `pose_delay`; while that is estimated, rotor speed is the reference, and of
logs that hold commands alone the gyro.

Commands in place of rotor speed are taken to be on time: their delay is a motor lag to first order, and of motors that
do not follow one lag (the Crazyflie of docs/evidence/studies/real_logs_motor_lag.md) the fit takes 15 ms for a
delay, halves the lag and puts inertias 45 % too high. Only on request (`Options.estimate_command_delay`) have they a
clock of their own.

A stream that is late by d showed at time t what was at t - d; read at t + d it agrees with the motion at t.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.options import Reference

ROTOR_SPEED, GYRO, ACCELEROMETER = "rotor_speed_rad_s", "rate_body_rad_s", "specific_force_body_m_s2"
COMMAND = "rotor_speed_command_rad_s"
NAMES = {
    ROTOR_SPEED: "rotor_speed_delay_s",
    COMMAND: "command_delay_s",
    GYRO: "gyro_delay_s",
    ACCELEROMETER: "accelerometer_delay_s",
}
"""Delay of each stream; every log has its own. A command is carried out some time after it was sent: such commands are
early, by a negative delay."""
STREAMS = {GYRO: "gyro", ACCELEROMETER: "accelerometer", ROTOR_SPEED: "rotor speed", COMMAND: "rotor speed command"}
"""In words."""
PRIOR_S = 0.02
"""Standard deviation of the prior on each: telemetry of speed controllers is late by 3 to 21 ms."""
HELD_S = 1e-6
"""The same of commands that are taken to be on time."""
LEAST_DELAY_S, SURE_SIGMAS = 1e-3, 3.0
"""Clocks that are off by less, or by fewer standard errors, are not spoken of."""
LONGEST_STEP_S = 0.01
"""A step of the fit changes no delay by more: further off, the slopes of the streams say nothing."""


def delay_name(quantity: str, log: int) -> str:
    """Of the delay of one stream of one log."""
    return f"{NAMES[quantity]}[{log}]"


def delay_of(quantity: str, flight: Flight, values: Mapping[str, float]) -> float:
    """Delay of a stream of a flight; zero where nothing is known of it."""
    return values.get(delay_name(quantity, flight.log_index), 0.0)


def estimated(flights: Iterable[Flight], reference: Reference, *, with_lag: bool) -> dict[str, float]:
    """Names of the delays of every log that are estimated, and the width of the prior on each.

    Args:
        with_lag: whether the vehicle has motors that lag. Without them commands are taken to be on time in any case:
            what is late about them is the lag's to explain.
    """
    found = {}
    for flight in flights:
        fixed = (reference_of(flight, reference), "" if with_lag else COMMAND)
        found |= {delay_name(q, flight.log_index): _width_s(q, flight) for q in flight.streams if q not in fixed}
    return dict(sorted(found.items()))


def widths_s(flights: Iterable[Flight], names: Iterable[str]) -> list[float]:
    """Of the priors on the delays of these names."""
    known = {delay_name(q, flight.log_index): _width_s(q, flight) for flight in flights for q in flight.streams}
    return [known[name] for name in names]


def held(flights: Iterable[Flight]) -> set[str]:
    """Names of the delays of commands that are taken to be on time."""
    return {delay_name(COMMAND, flight.log_index) for flight in flights if flight.commands_on_time}


def _width_s(quantity: str, flight: Flight) -> float:
    return HELD_S if quantity == COMMAND and flight.commands_on_time else PRIOR_S


def reference_of(flight: Flight, reference: Reference) -> str:
    """The stream of a flight whose clock the others are measured against; empty for the pose."""
    if not flight.has_pose:
        return GYRO
    if reference == "pose":
        return ""
    return next((q for q in (ROTOR_SPEED, GYRO) if q in flight.streams), COMMAND)


def moved_reading(
    quantity: str, flight: Flight, values: Mapping[str, float], *, between: bool
) -> tuple[FloatArray, FloatArray]:
    """What reading a stream by its delay later adds to its samples, and the derivative of that by the delay.

    Only the part of the stream that is no noise is moved. The noise stays in the samples, where it is white; were it
    interpolated too, the fit would be drawn to delays for which interpolation averages most.
    """
    signal, d = flight.streams[quantity], delay_of(quantity, flight, values)
    now_s, then_s = flight.time_s, flight.time_s + d
    if between:
        return signal.means(then_s)[0] - signal.means(now_s)[0], signal.means(then_s)[1]
    return signal.value(then_s) - signal.value(now_s), signal.slope(then_s)


@dataclass(frozen=True, slots=True)
class Clock:
    """How late one stream of one log was."""

    stream: str
    """`gyro`, `accelerometer`, `rotor speed` or `rotor speed command`."""
    against: str
    """The stream whose clock is the reference."""
    flight: str
    delay_s: float
    """Positive: its samples show what was that long before their time stamps."""
    std_robust: float
    """Standard error that allows for errors correlated within a block of time, and for noise of a gyro in the loop."""

    @property
    def off(self) -> bool:
        """Whether it is worth a word: surely not zero, and long enough to matter."""
        return abs(self.delay_s) > max(LEAST_DELAY_S, SURE_SIGMAS * self.std_robust)

    @property
    def sentence(self) -> str:
        late = "late" if self.delay_s > 0.0 else "early"
        said = (
            f"{self.flight}: {self.stream} is {1e3 * abs(self.delay_s):.1f} ± {1e3 * self.std_robust:.2g} ms {late} "
            f"against the {self.against}; the fit allows for it"
        )
        mended = self.against == "pose" and self.stream in (STREAMS[GYRO], STREAMS[ROTOR_SPEED])
        return f"{said}. `goshawk log fix` takes it out of the log if the log alone shows it" if mended else said


def pose_is_late(clocks: Sequence[Clock]) -> bool:
    """Whether all other streams of all flights are early against the pose, and by the same time.

    Then the pose is the one that is off. Rotor speed alone is taken so as well: telemetry is never ahead of the rotors.
    Commands are no witness, for they are ahead of the rotors on every vehicle; where nothing else is known of the
    rotors, the gyro is. Streams that are surely not as early as theirs, and nearer to no delay, are on time with the
    pose and speak against it being late, however short the delay; one that shows nothing speaks neither way.
    """
    against = [c for c in clocks if c.against == "pose" and c.stream != STREAMS[COMMAND]]
    rotors = [clock for clock in against if clock.stream == STREAMS[ROTOR_SPEED]]
    witnesses = rotors or [clock for clock in against if clock.stream == STREAMS[GYRO]]
    if not witnesses:
        return False
    common_s, std_s = _mean(witnesses)
    if not common_s < -max(LEAST_DELAY_S, SURE_SIGMAS * std_s):
        return False
    apart_s = min(LEAST_DELAY_S, -0.5 * common_s)
    others = [clock for clock in against if clock not in witnesses]
    agree = all(abs(c.delay_s - common_s) < apart_s + SURE_SIGMAS * c.std_robust for c in against)
    return agree and not (others and _on_time(others, common_s))


def _on_time(others: Sequence[Clock], common_s: float) -> bool:
    """Whether these, taken together, are nearer to no delay than to a common one, and not there by their error."""
    mean_s, std_s = _mean(others)
    return mean_s >= 0.5 * common_s and mean_s - common_s > SURE_SIGMAS * std_s


def _mean(clocks: Sequence[Clock]) -> tuple[float, float]:
    """Weighted mean of delays and its standard error, s."""
    weight = np.array([clock.std_robust**-2 for clock in clocks])
    return float(weight @ [clock.delay_s for clock in clocks] / weight.sum()), float(weight.sum()) ** -0.5


def gyro_is_early(clocks: Sequence[Clock]) -> bool:
    """Whether every gyro is early against the pose, yet not all streams are by the same time.

    No gyro shows what has not happened yet: either the pose is late, and another stream is by another time, or time
    stamps are wrong. The clocks alone do not show which.
    """
    gyros = [clock for clock in clocks if clock.against == "pose" and clock.stream == STREAMS[GYRO]]
    return bool(gyros) and all(c.off and c.delay_s < 0.0 for c in gyros) and not pose_is_late(clocks)


def commands_on_time(flights: Iterable[Flight]) -> list[str]:
    """What a lag of the motors may hide where commands drive the model and their delay is not estimated."""
    if not any(flight.commands_on_time for flight in flights):
        return []
    return [
        "rotor speed was not logged, and a delay of commands is confounded with motor_lag. Commands were taken to be "
        "on time, so the lag includes their delay. Log rotor speed; if another recorder than the gyro's stamped the "
        "commands, use `goshawk identify --estimate-command-delay`"
    ]


def sentences(clocks: Sequence[Clock]) -> list[str]:
    """What the user should know."""
    found = [clock.sentence for clock in clocks if clock.off]
    if pose_is_late(clocks):
        found.append(
            "every other stream is early against the pose by the same time, so it is the pose that is late: add the "
            "effect pose_delay, or shift the pose"
        )
    return found
