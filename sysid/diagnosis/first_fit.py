"""The fit a diagnosis begins with: disturbances as these flights need them, and by which clock."""

from collections.abc import Sequence
from dataclasses import replace

from flight import FlightLog, InputError, Progress
from sysid.estimator.fit_to_use import Chosen, fit_to_use
from sysid.estimator.flights.clocks import pose_is_late
from sysid.estimator.identification import identify
from sysid.estimator.options import Options
from vehicle import Vehicle


def first_fit(logs: Sequence[FlightLog], vehicle: Vehicle, options: Options, progress: Progress) -> Chosen:
    """The first fit, with disturbances and clock as these flights need them.

    Raises:
        InputError: no flight has a pose.
    """
    if not any(log.has("position_world_m") and log.has("q_world_body") for log in logs):
        raise InputError(
            "no flight has a pose, and effects are distinguished along a measured motion; `goshawk diagnose` names "
            "the faults that an IMU alone shows"
        )
    found = fit_to_use(logs, vehicle, options, progress=progress)
    if not pose_is_late(found.fit.clocks):
        return found
    # then that is an effect to be named, measured by the clock of the rotors
    options = replace(found.options, clock="rotor speed")
    return Chosen(identify(logs, vehicle, options, near=found.fit), options, found.said)
