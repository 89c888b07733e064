"""What must hold before the rotors start: no vehicle climbs for a flight that it then refuses."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from firmware_bridge.dialect.generated.messages import MissionState, State
from flight import FloatArray, LinkError, rotations

LOWEST_TAKE_OFF_M = 0.3
"""A start below this height is approached from above."""
_TILT_RAD = float(np.arccos(0.7))
_STILL_M_S, _STILL_RAD_S = 0.5, 0.5
"""As the vehicle itself judges (landing.c), which looks at the last .2 s."""
_ON_THE_GROUND = (MissionState.DISARMED, MissionState.ARMED)


@dataclass(frozen=True, slots=True)
class ArmingCheck:
    """One condition, as it is now."""

    name: str
    passed: bool
    finding: str
    """What was seen, against its bound."""
    remedy: str = ""
    """What makes it pass."""

    def __str__(self) -> str:
        return f"{self.name}: {self.finding}; {self.remedy}"


def checks(state: State, parameters: Mapping[str, float], start_world_m: FloatArray | None) -> tuple[ArmingCheck, ...]:
    """Every condition with its figure; the vehicle itself judges once more when it is told to arm.

    Args:
        state: the vehicle's last telemetry.
        parameters: of the vehicle, by name; a bound that it does not have is not checked.
        start_world_m: (3,) where the trajectory begins; None: none is to be flown.
    """
    found = [_mission(state), _estimate(state), _level(state), _at_rest(state), _battery(state, parameters)]
    if start_world_m is not None:
        top_world_m = _top_of_take_off(state, start_world_m)
        found += [_start(top_world_m, start_world_m, parameters), _geofence(state, top_world_m, parameters)]
    return tuple(found)


def required(found: tuple[ArmingCheck, ...]) -> None:
    """
    Raises:
        LinkError: a check failed; the message has each that did, and what makes it pass.
    """
    if failed := [str(check) for check in found if not check.passed]:
        raise LinkError(f"not armed. {'. '.join(failed)}")


def take_off_height_m(state: State, start_world_m: FloatArray) -> float:
    """How far to climb before the trajectory is started."""
    return max(float(start_world_m[2]) - state.position_world_m[2], LOWEST_TAKE_OFF_M)


def _top_of_take_off(state: State, start_world_m: FloatArray) -> FloatArray:
    top_world_m = np.array(state.position_world_m, dtype=np.float64)
    top_world_m[2] += take_off_height_m(state, start_world_m)
    return top_world_m


def _mission(state: State) -> ArmingCheck:
    mission = MissionState(state.mission_state)
    words = mission.name.lower().replace("_", " ")
    remedy = "disarm it to leave the fault" if mission is MissionState.FAULT else "land it first"
    return ArmingCheck("mission state", mission in _ON_THE_GROUND, words, remedy)


def _estimate(state: State) -> ArmingCheck:
    streams = {"position": 0b11, "attitude": 0b1100, "rate": 0b110000}  # TC_FAULT_ bits
    lost = [name for name, bits in streams.items() if state.estimate_faults & bits]
    finding = f"no usable {' and '.join(lost)}" if lost else "position, attitude and rate are usable"
    return ArmingCheck("estimator", not lost, finding, "start the localization, and wait for its first pose")


def _level(state: State) -> ArmingCheck:
    upwards = rotations.matrix(np.array(state.q_world_body))[2, 2]
    tilt_rad = float(np.arccos(np.clip(upwards, -1.0, 1.0)))
    finding = f"tilted {np.degrees(tilt_rad):.0f}°, at most {np.degrees(_TILT_RAD):.0f}°"
    return ArmingCheck("level", tilt_rad <= _TILT_RAD, finding, "put it on level ground")


def _at_rest(state: State) -> ArmingCheck:
    speed_m_s, rate_rad_s = (float(np.linalg.norm(v)) for v in (state.velocity_world_m_s, state.rate_body_rad_s))
    finding = f"{speed_m_s:.2f} m/s, {rate_rad_s:.2f} rad/s; at most {_STILL_M_S:.1f} of each"
    return ArmingCheck("at rest", speed_m_s <= _STILL_M_S and rate_rad_s <= _STILL_RAD_S, finding, "let it stand still")


def _battery(state: State, parameters: Mapping[str, float]) -> ArmingCheck:
    least_v = parameters.get("battery_arm_v", 0.0)
    if not state.battery_v > 0.0:
        return ArmingCheck("battery", True, "not measured")
    finding = f"{state.battery_v:.1f} V, {f'at least {least_v:.1f} V' if least_v else 'without a limit'}"
    return ArmingCheck("battery", state.battery_v >= least_v, finding, "charge or change it")


def _start(top_world_m: FloatArray, start_world_m: FloatArray, parameters: Mapping[str, float]) -> ArmingCheck:
    far_m, radius_m = float(np.linalg.norm(start_world_m - top_world_m)), parameters.get("start_radius_m", np.inf)
    x_m, y_m = start_world_m[:2]
    return ArmingCheck(
        "start", far_m <= radius_m,
        f"the trajectory begins {far_m:.2f} m from the end of the take-off, at most {radius_m:.2f} m",
        f"put the vehicle at x {x_m:.2f}, y {y_m:.2f} m, or plan from where it stands",
    )  # fmt: skip


def _geofence(state: State, top_world_m: FloatArray, parameters: Mapping[str, float]) -> ArmingCheck:
    path = np.stack([np.array(state.position_world_m), top_world_m])
    least, most = (np.array([parameters.get(f"fence_{end}_{axis}_m", sign * np.inf) for axis in "xyz"])
                   for end, sign in (("min", -1.0), ("max", 1.0)))  # fmt: skip
    inside = bool(np.all((path >= least) & (path <= most)))
    finding = "the take-off is inside" if inside else "the take-off leaves it"
    return ArmingCheck(
        "geofence", inside, finding, "carry the vehicle inside, or widen the parameters fence_min and fence_max"
    )
