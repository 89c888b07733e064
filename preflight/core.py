"""Many flights of the C controller on the vehicle's dynamics in one call: all processors, no Python in the loop.

The same seed and flight number give the same bits, whatever the number of threads and of flights.
"""

import os
from collections.abc import Collection
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmware_bridge import wire
from firmware_bridge.controller import Configuration, RefusedError, vector
from firmware_bridge.sitl_vehicle import Sensors
from flight import FloatArray, InputError, Trajectory
from preflight import _preflight
from preflight.luck import Luck
from vehicle import Vehicle, native

FINISHED, FAILSAFE, NOT_STARTED, TIMED_OUT, DIVERGED = range(5)
"""How a flight ends; `Ending` of preflight/src/flight.hpp."""
RATE_HZ = 400
"""Of the controller, where nobody tells it: that of `goshawk sitl`."""
SLOWEST_HZ, FASTEST_HZ = 400, 1000
SAMPLE_S = 0.008
"""Between recorded positions: 3 cm of way at 8 m/s to either side of one."""
SETTLE_S = 3.0
"""Hover before the start: the wind rises in its first second, and the observer finds it."""
AFTER_S = 1.0
"""Flight that is recorded after the end of the trajectory."""
AFTER_FAILSAFE_S = 4.0
"""... and after it was given up: braking from 8 m/s takes two."""
NONE = 255
"""State of a sample that was not flown."""
DRAW_COLUMNS = (
    "wind_x_m_s", "wind_y_m_s", "wind_z_m_s", "gust_std_m_s", "pose_delay_s", "bias_x_m", "bias_y_m", "bias_z_m",
    "heading_bias_rad", "drop_outs_per_s", "drop_out_s", "jump_x_m", "jump_y_m", "jump_z_m",
    "start_x_m", "start_y_m", "start_z_m", "start_yaw_rad",
    "hover0_rad_s", "hover1_rad_s", "hover2_rad_s", "hover3_rad_s", "battery_v", "battery_fall_v_j",
    "battery_empty_v", "fault_rotor", "fault_at", "fault_ratio", "jump_at", "updraft_m_s",
)  # fmt: skip
"""Columns of the draws of `Loop.fly`; `Draw` of preflight/src/flight.hpp."""
WEAK = "weak_rotor"
"""The effect by which a rotor loses thrust."""
NOISE, GUSTS, DROP_OUTS = WITHIN = ("sensor noise", "gusts", "drop-outs")
"""What comes anew in every flight, and no number drawn before it explains; `Seeds` of preflight/src/flight.hpp."""
_OTHER_SEED = 1 << 32
assert len(DRAW_COLUMNS) == _preflight.DRAW


@dataclass(frozen=True, slots=True)
class Flown:
    """A batch of m flights: n samples of each from the hover before its start on, `SAMPLE_S` apart."""

    position_world_m: NDArray[np.float32]
    """(m, n, 3) of the centre of mass; NaN after the end, as all that follows."""
    error_m: NDArray[np.float32]
    """(m, n) distance from the set-point."""
    path_s: NDArray[np.float32]
    """(m, n) time on the trajectory; NaN off it."""
    state: NDArray[np.uint8]
    """(m, n) of the controller's mission; `NONE` after the end."""
    ending: NDArray[np.int64]
    """(m,) `FINISHED`, `FAILSAFE`, `NOT_STARTED`, `TIMED_OUT` or `DIVERGED`."""
    end_state: NDArray[np.int64]
    """(m,) of the mission when it ended."""
    reason: NDArray[np.int64]
    """(m,) the controller's reason for that."""
    ended_s: FloatArray
    """(m,) from the start; of the hover before it if it ended there."""
    tilt_rad: FloatArray
    """(m,) largest, also after the end."""
    fell: NDArray[np.bool_]
    """(m,) whether it ever was in an emergency descent or fault, also after the end."""
    rotor_reserve: FloatArray
    """(m,) least `Limits.rotor_margin` on the trajectory."""
    energy_j: FloatArray
    """(m,) mechanical, of the rotors, from hover to the end."""
    steps: int
    """Control steps flown, of all flights."""
    strain: FloatArray = field(default_factory=lambda: np.zeros(0))
    """(m,) how near the controller came to giving the flight up, before it did: 1 where it has cause to."""

    def __len__(self) -> int:
        return len(self.ending)


@dataclass(frozen=True, slots=True)
class Air:
    """What the air does besides the mean wind."""

    gust_length_m: float = 5.0
    """Dryden's length; MIL-F-8785C gives 2 m across and 8 m along the wind at 2 m height."""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.gust_length_m) and self.gust_length_m > 0.0):
            raise InputError(f"gust_length_m is {self.gust_length_m}; it must be a finite number above 0")


class Loop:
    """One trajectory, one controller and one form of vehicle, for any number of flights."""

    def __init__(
        self,
        vehicle: Vehicle,
        trajectory: Trajectory,
        configuration: Configuration,
        *,
        clearance_m: float = 0.0,
        sensors: Sensors | None = None,
        air: Air | None = None,
        rate_hz: int = RATE_HZ,
        rotor_speed_measured: bool = False,
        floor_m: float = -np.inf,
        ceiling_m: float = np.inf,
    ) -> None:
        """
        Args:
            vehicle: what flies, as `draws.flown_form` returns it; its values are those of the draws.
            configuration: of the controller.
            clearance_m: room for the tracking error, by which the controller's supervisor judges; 0: not stated.
            sensors: noise of the estimate; its `delay_s` is the one that time stamps tell.
            rate_hz: of the controller, `SLOWEST_HZ` to `FASTEST_HZ`.
            rotor_speed_measured: whether the controller is given the rotors' speeds; few vehicles measure them.
            floor_m, ceiling_m: heights, for the effects of the model that depend on them.

        Raises:
            InputError: effects of the user's own act on mass or motors, or the rate is out of range.
            RefusedError: the controller refuses its parameters or the trajectory.
        """
        kernel = _kernel(vehicle)
        require_rate(rate_hz)
        self._kernel, self.names = kernel, (*kernel.names, *kernel.own_names)
        self.trajectory = trajectory
        self._tick_us = round(1e6 / rate_hz)
        self._every = max(round(SAMPLE_S * rate_hz), 1)
        self._limit_s = 1.25 * trajectory.duration_s + 6.0
        noise = [getattr(sensors or Sensors.typical(), item.name) for item in fields(Sensors)][:7]
        start = trajectory.evaluate([0.0])[0]
        common = [
            *noise, self._tick_us, self._every, vehicle.gravity_m_s2, (air or Air()).gust_length_m,
            vehicle.limits.rotor_speed_min_rad_s, vehicle.limits.rotor_speed_max_rad_s, *start, SETTLE_S, self._limit_s,
            AFTER_S, AFTER_FAILSAFE_S, rotor_speed_measured, trajectory.duration_s,
            kernel.names.index(f"{WEAK}.loss_0"), floor_m, ceiling_m,
        ]  # fmt: skip
        plan = wire.plan_from_trajectory(trajectory, clearance_m=clearance_m)
        self._flights = _preflight.Flights(
            kernel.marked, kernel.own, vehicle.hub_body_m, vehicle.spin, vector(configuration.parameters),
            plan.durations_us, plan.coefficients, plan.clearance_m, np.array(common, dtype=np.float64),
        )  # fmt: skip
        reason, segment = self._flights.refused()
        if reason:
            raise RefusedError(f"the trajectory (segment {segment})", reason)

    @property
    def samples(self) -> int:
        """Of a flight at most."""
        return int((SETTLE_S + self._limit_s) * 1e6 / self._tick_us) // self._every + 1

    def fly(
        self,
        values: FloatArray,
        draws: FloatArray,
        *,
        seed: int,
        numbers: NDArray[np.integer] | Luck | None = None,
        anew: Collection[str] = (),
        threads: int | None = None,
    ) -> Flown:
        """Fly one flight for each row.

        Args:
            values: (m, p) of the parameters `names`.
            draws: (m, d) of `DRAW_COLUMNS`.
            seed: 0 to 2^32 - 1.
            numbers: (m,) of these flights, or their luck: noise and gusts depend on that and the seed alone. By default
                from 0 on.
            anew: those of `WITHIN` that are to be others than this seed's.

        Raises:
            InputError: a row is missing or has another length.
        """
        m, n = len(draws), self.samples
        numbers = np.arange(m) if numbers is None else numbers
        luck = numbers if isinstance(numbers, Luck) else Luck.of(numbers)
        wanted = {"values": (m, len(self.names)), "draws": (m, len(DRAW_COLUMNS)), "numbers": (m,)}
        given = {"values": values.shape, "draws": draws.shape, "numbers": luck.numbers.shape[:1]}
        for name, shape in wanted.items():
            if given[name] != shape:
                raise InputError(f"{name} have shape {given[name]}, expected {shape}")
        seeds = np.array([seed + _OTHER_SEED * (name in anew) for name in WITHIN], np.uint64)
        values, draws = np.ascontiguousarray(values, np.float64), np.ascontiguousarray(draws, np.float64)
        positions = np.full((m, n, 3), np.nan, np.float32)
        errors, path_s = np.full((m, n), np.nan, np.float32), np.full((m, n), np.nan, np.float32)
        states, summary = np.full((m, n), NONE, np.uint8), np.zeros((m, _preflight.SUMMARY))
        threads = (os.cpu_count() or 1) if threads is None else threads
        rows = (values, draws, np.ascontiguousarray(luck.numbers), np.ascontiguousarray(luck.weights))
        kept = (positions, errors, path_s, states, summary)
        if self._kernel.own:
            self._fly_one_by_one(rows, seeds, kept)
        else:
            self._flights.fly(*rows, seeds, threads, *kept)
        ending, state, reason = (summary[:, i].astype(np.int64) for i in range(3))
        steps = round(float(summary[:, 8].sum()) * 1e6 / self._tick_us)
        return Flown(
            positions, errors, path_s, states, ending, state, reason, summary[:, 3], summary[:, 4], summary[:, 5] > 0.0,
            summary[:, 6], summary[:, 7], steps, summary[:, 9],
        )  # fmt: skip

    def _fly_one_by_one(
        self, rows: tuple[Any, Any, Any, Any], seeds: NDArray[np.uint64], kept: tuple[Any, Any, Any, Any, Any]
    ) -> None:
        """With effects in Python, which read one flight's values at a time."""
        values, width = rows[0], self._flights.width
        compiled = np.ascontiguousarray(values[:, :width])
        for i in range(len(values)):
            self._kernel.set_own(values[i, width:])
            draws, numbers, weights = (part[i : i + 1] for part in rows[1:])
            positions, errors, path_s, states, summary = (part[i : i + 1] for part in kept)
            self._flights.fly(
                compiled[i : i + 1], draws, numbers, weights, seeds, 1, positions, errors, path_s, states, summary
            )


def _kernel(vehicle: Vehicle) -> native.Stepped:
    """What the flights' kernel is made of.

    Raises:
        InputError: effects of the user's own act where the kernel does not call them, or the rotors are tilted.
    """
    kernel = native.stepped(vehicle)
    if kernel is not None:
        return kernel
    names = ", ".join(native.without_callback(vehicle))
    what = f"effects of your own on mass or motors ({names})" if names else "tilted rotors"
    out = "leave them out with `goshawk vehicle effect`, or fly" if names else "fly"
    raise InputError(f"{vehicle.name} has {what}, which a preflight cannot fly; {out} it with `goshawk sitl`")


def require_rate(rate_hz: int) -> None:
    """Check that the controller can run so often.

    Raises:
        InputError: it cannot.
    """
    if not SLOWEST_HZ <= rate_hz <= FASTEST_HZ:
        raise InputError(
            f"a control rate of {rate_hz} Hz: it must be {SLOWEST_HZ} to {FASTEST_HZ}, as the observer needs"
        )


def sensed(vehicle: Vehicle) -> list[str]:
    """Names of the effects that act on its sensors, which do not move it."""
    from vehicle import effects
    from vehicle.effects.base import Stage

    return [name for name in vehicle.effects if effects.find(name).stage == Stage.SENSOR]
