"""The three manoeuvres that identify a vehicle without a pose, as a simulated pilot flies them."""

import functools
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from flight import FlightLog
from sysid.report import drawing

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
DURATION_S, SHOWN_S = 18.0, 4.0
"""Of the flight, whose thirds are the manoeuvres, and of what is shown of each."""


def draw(style: drawing.Style) -> Figure:
    """Motor commands above, what the IMU feels of them below; one column for each manoeuvre."""
    log = _flown()
    command = np.stack([log.columns[f"motor_command_{i}_ratio"] for i in range(4)], axis=1)
    rate, force = log.vector("rate_body_rad_s"), log.vector("specific_force_body_m_s2")[:, 2:]
    columns = (
        ("throttle steps: thrust and motor lag", force, "force along the thrust (m/s²)", ("felt",)),
        ("rolls and pitches: inertia about x and y", rate[:, :2], "rate (rad/s)", ("roll", "pitch")),
        ("yaws: torque over inertia about z", rate[:, 2:], "rate (rad/s)", ("yaw",)),
    )
    with drawing.styled(style) as look:
        figure, axes = drawing.figure(2, 3, (11.5, 4.2), sharex="col")
        for i, (title, shown, unit, names) in enumerate(columns):
            begins = i * DURATION_S / 3.0 + 1.0
            rows = (log.time_s >= begins) & (log.time_s < begins + SHOWN_S)
            time_s = log.time_s[rows] - begins
            above, below = axes[:, i]
            for rotor in range(4):
                above.plot(time_s, command[rows, rotor], color=look.colours[rotor], linewidth=0.9)
            for part, name in enumerate(names):
                below.plot(time_s, shown[rows, part], color=look.colours[part], linewidth=1.0, label=name)
            drawing.plain(above, title, "", "motor command")
            drawing.plain(below, "", "time (s)", unit)
            above.set_ylim(0.0, 1.0)
            if len(names) > 1:
                below.legend(loc="upper right", fontsize=8, frameon=False)
    return figure


@functools.cache
def _flown() -> FlightLog:
    sys.path.insert(0, str(BENCHMARKS))
    import without_pose_flights as flights

    sys.path.remove(str(BENCHMARKS))
    rng = np.random.default_rng(3)
    values = flights.drawn(1, rng)
    (log,) = flights.flown(flights.body(), values, rng, duration_s=DURATION_S)
    return log
