"""What removes an uncertainty: in words, and in the draws."""

from dataclasses import replace

from preflight.core import DROP_OUTS, GUSTS, NOISE
from preflight.draws import BATTERY, MOTOR_FAULT, POSE_JUMP, THERMALS, Uncertainty
from vehicle import Vehicle

_FIELDS = {
    "wind": ("wind_m_s",), GUSTS: ("gust_std_m_s",), "pose delay": ("pose_delay_std_s",),
    "localization": ("localization_std_m",), "heading": ("heading_std_rad",), "map scale": ("map_scale_std_ratio",),
    "map surface": ("map_error_std_m",), "start": ("start_std_m",), "rotor wear": ("rotor_wear_ratio",),
    NOISE: ("noise_ratio",), DROP_OUTS: ("drop_outs_per_s",), MOTOR_FAULT: ("motor_fault_ratio",),
    POSE_JUMP: ("pose_jump_std_m",), THERMALS: ("thermal_std_m_s",),
}  # fmt: skip
_WORDS = {
    "wind": "wait for less wind, or plan with a larger --margin",
    GUSTS: "wait for less wind, or plan with a larger --margin",
    NOISE: "improve the estimate, or plan slower (goshawk plan --speed)",
    DROP_OUTS: "give the estimator more light, texture or processor time, until its pose has no gaps",
    "pose delay": "identify from a log of the pose: it tells the delay; or send true time stamps",
    "localization": "take more images along the path, and localize there",
    "heading": "calibrate the camera's mounting",
    "map scale": "measure one length in the room (goshawk map build --length)",
    "map surface": "map the narrowest place again, from nearer",
    "start": "hover nearer to the start before it is flown",
    "rotor wear": "change the propellers, and identify again",
    "mass_kg": "weigh the vehicle",
    THERMALS: "fly lower, or when the ground is cooler",
    BATTERY: "start with a fuller battery (--battery)",
    MOTOR_FAULT: "plan slower, or with a larger --margin",
    POSE_JUMP: "refuse poses that jump, or plan with a larger --margin",
}


OR = " or "
"""Between the names of a factor of several kinds of luck, which are not told apart."""


def words(factor: str) -> str:
    """What to do about a factor."""
    if OR in factor:
        return "; or ".join(words(each) for each in factor.split(OR))
    return _WORDS.get(factor, "fly what `goshawk next-flight` proposes, and identify again")


def without(vehicle: Vehicle, uncertainty: Uncertainty, factor: str) -> tuple[Vehicle, Uncertainty]:
    """The same draws with one factor known exactly."""
    if factor == BATTERY:
        return vehicle, replace(uncertainty, battery_v=None)
    if OR in factor:
        for each in factor.split(OR):
            vehicle, uncertainty = without(vehicle, uncertainty, each)
        return vehicle, uncertainty
    if factor in _FIELDS:
        return vehicle, replace(uncertainty, **dict.fromkeys(_FIELDS[factor], 0.0))
    for name in factor.split(" with "):
        p = vehicle.parameter(name)
        vehicle = vehicle.with_value(name, p.value, std=0.0, source=p.source)
    return vehicle, uncertainty
