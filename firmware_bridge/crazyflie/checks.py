"""What of a Crazyflie must hold before its rotors start: supervisor, battery, estimator, and where it stands."""

from collections.abc import Iterator

import numpy as np

from firmware_bridge.arming import ArmingCheck
from firmware_bridge.crazyflie.client import LOST, Bits
from flight import FloatArray

LEAST_V, ONE_CELL_V = 3.7, 4.5
"""At rest, of a single cell; a pack above `ONE_CELL_V` is judged by the firmware alone."""
POWER_LOW, POWER_OFF, CHARGING = 3, 4, 1
"""`pm.state`."""
LARGEST_STD_M, LARGEST_WANDER_M = 0.05, 0.03
"""By the Kalman filter's variance, and by how far the estimate wanders within a second at rest."""
NEAR_M, LEVEL_RAD = 0.3, 0.3


def checks(
    bits: Bits, *, battery_v: float, power: int, variance_m2: FloatArray, position_world_m: FloatArray,
    up_z: float, start_world_m: FloatArray,
) -> tuple[ArmingCheck, ...]:  # fmt: skip
    """Every condition with what was read.

    Args:
        variance_m2: (3,) of the position, by the filter.
        position_world_m: (n, 3) of the last second.
        up_z: of the body's z axis, along world z.
    """
    found = [*supervisor(bits), _battery(battery_v, power)]
    found += [_filter(variance_m2), _wander(position_world_m), _level(up_z)]
    return (*found, _near(position_world_m[-1], start_world_m))


def supervisor(bits: Bits) -> Iterator[ArmingCheck]:
    """What it says of itself, before anything is logged."""
    bad = LOST | Bits.DECK_FAULT
    lost = [bit.name.lower().replace("_", " ") for bit in Bits if bit in bad & bits and bit.name]
    yield ArmingCheck("supervisor", not lost, ", ".join(lost) or "well", "set it upright, and switch it off and on")
    yield ArmingCheck("flying", Bits.FLYING not in bits, "flies" if Bits.FLYING in bits else "stands", "land it first")
    armable = bool(bits & (Bits.CAN_BE_ARMED | Bits.ARMED | Bits.AUTO_ARMED))
    yield ArmingCheck("arming", armable, "can be armed" if armable else "cannot be armed", "see its console for why")
    disabled = Bits.COMMANDER_DISABLED in bits
    yield ArmingCheck(
        "high-level commander", not disabled, "disabled" if disabled else "enabled", "stop whatever sends set-points"
    )


def _battery(battery_v: float, power: int) -> ArmingCheck:
    one_cell = battery_v < ONE_CELL_V
    good = power not in (POWER_LOW, POWER_OFF, CHARGING) and (battery_v >= LEAST_V or not one_cell)
    finding = (
        f"{battery_v:.2f} V{', charging' if power == CHARGING else ''}, at least {LEAST_V} a cell, off the charger"
    )
    return ArmingCheck("battery", good, finding, "charge it, and unplug it")


def _filter(variance_m2: FloatArray) -> ArmingCheck:
    std_m = float(np.sqrt(np.max(variance_m2)))
    return ArmingCheck(
        "Kalman filter", std_m <= LARGEST_STD_M, f"sure to {std_m:.3f} m, at most {LARGEST_STD_M}",
        "start its positioning (Lighthouse, LPS, motion capture), and let it stand",
    )  # fmt: skip


def _wander(position_world_m: FloatArray) -> ArmingCheck:
    far_m = float(np.ptp(position_world_m, axis=0).max())
    return ArmingCheck(
        "estimate at rest", far_m <= LARGEST_WANDER_M, f"wanders {far_m:.3f} m, at most {LARGEST_WANDER_M}",
        "let it stand still; reset the estimator (kalman.resetEstimation)",
    )  # fmt: skip


def _level(up_z: float) -> ArmingCheck:
    tilt_rad = float(np.arccos(np.clip(up_z, -1.0, 1.0)))
    finding = f"tilted {np.degrees(tilt_rad):.0f}°, at most {np.degrees(LEVEL_RAD):.0f}°"
    return ArmingCheck("level", tilt_rad <= LEVEL_RAD, finding, "put it on level ground")


def _near(position_world_m: FloatArray, start_world_m: FloatArray) -> ArmingCheck:
    far_m = float(np.linalg.norm((start_world_m - position_world_m)[:2]))
    x_m, y_m = start_world_m[:2]
    return ArmingCheck(
        "start", far_m <= NEAR_M, f"the trajectory begins {far_m:.2f} m from above it, at most {NEAR_M}",
        f"put it at x {x_m:.2f}, y {y_m:.2f} m, or plan from where it stands",
    )  # fmt: skip
