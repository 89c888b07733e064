"""Between body rates, throttle, and the receiver's pulses in microseconds, by the firmware's rate profile."""

import math
from dataclasses import dataclass

import numpy as np

from flight import FloatArray, InputError

MIDDLE_US, HALF_US = 1500.0, 500.0
LOWEST_US, HIGHEST_US = 1000.0, 2000.0
_SIGNS = (1.0, 1.0, -1.0)
"""Stick to body rate about x forward, y left, z up: right roll, nose down, and a yaw that Betaflight counts
clockwise."""


@dataclass(frozen=True, slots=True)
class RateProfile:
    """Betaflight's ACTUAL rates with as large a centre as end and no expo: rates in proportion to the stick."""

    largest_rad_s: tuple[float, float, float]
    """At full stick: roll, pitch, yaw."""
    throttle_from_us: float = 1050.0
    """`min_check`: where the throttle begins."""

    @staticmethod
    def of_settings(settings: dict[str, str]) -> "RateProfile":
        """From `roll_srate` and so on, in tens of degrees per second.

        Raises:
            InputError: a setting is missing or no number.
        """
        try:
            rates = [math.radians(10.0 * float(settings[f"{axis}_srate"])) for axis in ("roll", "pitch", "yaw")]
            return RateProfile((rates[0], rates[1], rates[2]), float(settings["min_check"]))
        except (KeyError, ValueError) as wrong:
            raise InputError(f"the firmware's rate profile is incomplete: {wrong}") from wrong

    def pulses_us(self, rate_body_rad_s: FloatArray, throttle: float) -> tuple[int, int, int, int]:
        """Roll, pitch, throttle, yaw: what the firmware turns into these rates and this throttle of 0 to 1."""
        sticks = np.clip(np.array(_SIGNS) * rate_body_rad_s / np.array(self.largest_rad_s), -1.0, 1.0)
        roll, pitch, yaw = (MIDDLE_US + HALF_US * float(stick) for stick in sticks)
        open_us = self.throttle_from_us + (HIGHEST_US - self.throttle_from_us) * min(max(throttle, 0.0), 1.0)
        return round(roll), round(pitch), round(open_us if throttle > 0.0 else LOWEST_US), round(yaw)

    def commanded(self, pulses_us: tuple[float, ...]) -> tuple[FloatArray, float]:
        """The body rates (3,) and the throttle that the firmware reads from roll, pitch, throttle, yaw."""
        roll, pitch, throttle_us, yaw = pulses_us[:4]
        sticks = (np.array([roll, pitch, yaw]) - MIDDLE_US) / HALF_US
        throttle = (throttle_us - self.throttle_from_us) / (HIGHEST_US - self.throttle_from_us)
        return np.array(_SIGNS) * sticks * np.array(self.largest_rad_s), float(np.clip(throttle, 0.0, 1.0))
