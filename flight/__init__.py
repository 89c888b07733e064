"""Ground floor: what every part of Goshawk shares. Frames, polynomials, trajectories, logs, files, errors."""

from flight.errors import FlightError, FormatError, InfeasibleError, InputError, LinkError, MapError
from flight.flight_log import FlightLog
from flight.progress import Progress, silent, within
from flight.project import Project, Waypoints
from flight.rotations import FloatArray
from flight.trajectory import Trajectory, TrajectoryFile

__all__ = [
    "FlightError",
    "FlightLog",
    "FloatArray",
    "FormatError",
    "InfeasibleError",
    "InputError",
    "LinkError",
    "MapError",
    "Progress",
    "Project",
    "Trajectory",
    "TrajectoryFile",
    "Waypoints",
    "silent",
    "within",
]
