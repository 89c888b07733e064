"""A Betaflight as the guard's inner loop: force and rates become the pulses of a receiver."""

import numpy as np

from firmware_bridge.offboard.firmware import Firmware, FirmwareState, reasons
from firmware_bridge.offboard.ladder import Stage
from firmware_bridge.offboard.messages import Setup, Target
from firmware_bridge.offboard.poses import Pose
from flight import FloatArray

CHANNELS = 8
_DISARM_US = 1000
_LEVELLING = {1, 2, 3, 11, 27, 46}
"""Of the firmware's modes: centred sticks are level in them, and rates are read as angles."""


class Sticks:
    """An `InnerLoop` by MSP, which knows no targets."""

    by_targets, apart = False, ""

    def __init__(self, setup: Setup, firmware: Firmware) -> None:
        self._setup, self._firmware = setup, firmware
        self.pilot_arms = not setup.by_msp_alone

    @property
    def state(self) -> FirmwareState:
        return self._firmware.state

    @property
    def ours(self) -> bool:
        """MSP is the only receiver, or the override switch is on."""
        return self._setup.by_msp_alone or self.state.overriding

    @property
    def said(self) -> str:
        return ", ".join(reasons(self.state.arming_flags))

    def listen(self, now_s: float) -> None:
        self._firmware.listen(now_s)

    def seen(self, now_s: float, pose: Pose) -> None:
        """Betaflight has no use for poses."""

    def command(
        self, now_s: float, stage: Stage, force_n: float, rate_body_rad_s: FloatArray, target: Target | None = None
    ) -> None:
        """Sticks are rates and throttle."""
        del target
        setup = self._setup
        if stage is Stage.DESCENDING and _LEVELLING.intersection(self.state.other_modes):
            rate_body_rad_s = np.zeros(3)
        throttle = setup.thrust.throttle(force_n, self.state.battery_v) if force_n > 0.0 else 0.0
        channels = [*setup.profile.pulses_us(rate_body_rad_s, throttle), *[_DISARM_US] * (CHANNELS - 4)]
        if setup.by_msp_alone and stage in (Stage.FOLLOWING, Stage.DESCENDING):
            channels[setup.arm_channel] = setup.arm_us
        self._firmware.sticks(tuple(channels))
        self._firmware.ask()
