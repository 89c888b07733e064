"""A plant of the tests' own physics (tests/sysid/flying.py), in wind: shares no line with `vehicle` or a preflight."""

import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, Protocol, TypeVar

import numpy as np

from flight import FloatArray, rotations
from tests.sysid import flying

T = TypeVar("T")
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
SLOWEST_M_S = 0.5
"""At which air drifts past a hovering vehicle all the same."""


class VonKarman:
    """Gusts of von Karman's spectra (MIL-F-8785C, 3.7.1), frozen along the way through the air: sums of cosines."""

    WAVES = np.geomspace(1e-3, 40.0, 161)
    """Between which each cosine has its wave number, rad/m."""

    def __init__(self, std_m_s: float, length_m: float, wind_m_s: FloatArray, rng: np.random.Generator) -> None:
        self.waves = np.sqrt(self.WAVES[1:] * self.WAVES[:-1])
        square = (1.339 * length_m * self.waves) ** 2
        along = 2.0 / (1.0 + square) ** (5 / 6)
        across = (1.0 + 8 / 3 * square) / (1.0 + square) ** (11 / 6)
        power = np.array([along, across, across]) * np.diff(self.WAVES)
        self.sizes = std_m_s * np.sqrt(2.0 * power / power.sum(axis=1, keepdims=True))
        self.phases = rng.uniform(0.0, 2.0 * np.pi, self.sizes.shape)
        x, y = wind_m_s[:2] / max(float(np.hypot(*wind_m_s[:2])), 1e-12)
        self.axes = np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]])

    def at(self, way_m: float) -> FloatArray:
        """(3,) in world axes."""
        return (self.sizes * np.cos(self.waves * way_m + self.phases)).sum(axis=1) @ self.axes


class Physics(Protocol):
    """Other equations of motion than those of tests/sysid/flying.py, in still air."""

    def steps(self, truths: Sequence[Any], state: FloatArray, command: FloatArray, duration_s: float) -> FloatArray:
        """The next states (n, 17) of as many truths of this kind: position, velocity, quaternion, rate, rotors."""
        ...


def stepped(truths: Sequence[Any], state: FloatArray, command: FloatArray, duration_s: float) -> FloatArray:
    """The next states (n, 17) of as many truths, alike but for their lags."""
    first = truths[0]
    if not isinstance(first, flying.Truth):
        return first.steps(truths, state, command, duration_s)
    common = replace(first, lag=np.array([[truth.lag] for truth in truths]))
    return flying._step(common, state, command, duration_s)


class Together:
    """Flights in lock step, each in a thread of its own: their plants move in one call, which costs little more than
    one plant's."""

    def __init__(self, flights: int) -> None:
        self._changed, self._left = threading.Condition(), flights
        self._asked: dict[int, tuple[flying.Truth | Physics, FloatArray, FloatArray]] = {}
        self._moved: dict[int, FloatArray] = {}
        self._failed: BaseException | None = None

    def fly(self, flights: Iterable[Callable[[], T]]) -> list[T]:
        """What each returns.

        Raises:
            BaseException: that of the first flight that failed; it ends the others.
        """
        with ThreadPoolExecutor(self._left) as threads:
            return list(threads.map(self._one, flights))

    def _one(self, flight: Callable[[], T]) -> T:
        try:
            return flight()
        except BaseException as error:
            with self._changed:
                self._fail(error)
            raise
        finally:
            with self._changed:
                self._left -= 1
                self._try_to_move()

    def step(
        self, truth: flying.Truth | Physics, state: FloatArray, command: FloatArray, duration_s: float
    ) -> FloatArray:
        """A plant's next state (1, 17), once all have asked for theirs, of equal duration."""
        me = threading.get_ident()
        with self._changed:
            self._asked[me], self._duration_s = (truth, state, command), duration_s
            self._try_to_move()
            self._changed.wait_for(lambda: me in self._moved or self._failed is not None)
            if self._failed is not None:
                raise self._failed
            return self._moved.pop(me)

    def _fail(self, error: BaseException) -> None:
        self._failed = self._failed or error
        self._changed.notify_all()

    def _try_to_move(self) -> None:
        """A plant that cannot be moved ends all flights, too."""
        try:
            self._move_if_all()
        except BaseException as error:
            self._fail(error)

    def _move_if_all(self) -> None:
        if not self._asked or len(self._asked) < self._left or self._failed is not None:
            return
        truths, states, commands = zip(*self._asked.values(), strict=True)
        after = stepped(truths, np.concatenate(states), np.stack(commands), self._duration_s)
        self._moved = {me: row[None] for me, row in zip(self._asked, after, strict=True)}
        self._asked = {}
        self._changed.notify_all()


class OtherPlant:
    """One vehicle, at rest on the ground below a point; steps of the fourth-order Runge-Kutta rule.

    Flown is what moves with the air (Galilei), so that forces are those of still air; a gust moves the air.
    """

    battery_v = 16.8

    def __init__(
        self,
        truth: flying.Truth | Physics,
        start_world_m: FloatArray,
        *,
        wind_m_s: FloatArray,
        gusts: VonKarman,
        together: Together | None = None,
    ) -> None:
        self.truth, self.gusts, self.mean_m_s = truth, gusts, np.asarray(wind_m_s, np.float64)
        self.together = together
        self.ground_m, self.time_s, self.way_m = float(start_world_m[2]), 0.0, 0.0
        self.air_m_s = self.mean_m_s + gusts.at(0.0)
        self.carried_m = np.zeros(3)
        self.state = np.concatenate([start_world_m, -self.air_m_s, LEVEL, np.zeros(3), np.full(4, 300.0)])[None]
        self.specific_force_body_m_s2 = -flying.GRAVITY

    @property
    def position_world_m(self) -> FloatArray:
        return self.state[0, :3] + self.carried_m

    @property
    def velocity_world_m_s(self) -> FloatArray:
        return self.state[0, 3:6] + self.air_m_s

    @property
    def q_world_body(self) -> FloatArray:
        return self.state[0, 6:10]

    @property
    def rate_body_rad_s(self) -> FloatArray:
        return self.state[0, 10:13]

    @property
    def rotor_speed_rad_s(self) -> FloatArray:
        return self.state[0, 13:]

    def step(self, rotor_speed_command_rad_s: FloatArray, duration_s: float) -> None:
        before = self.velocity_world_m_s
        self.state = self._moved(np.asarray(rotor_speed_command_rad_s), duration_s)
        self.time_s += duration_s
        self.carried_m = self.carried_m + duration_s * self.air_m_s
        self._stand()
        felt = (self.velocity_world_m_s - before) / duration_s - flying.GRAVITY
        self.specific_force_body_m_s2 = rotations.rotate(rotations.conjugate(self.q_world_body), felt)
        self._blow(duration_s)

    def _moved(self, command: FloatArray, duration_s: float) -> FloatArray:
        if self.together is None:
            return stepped([self.truth], self.state, command[None], duration_s)
        return self.together.step(self.truth, self.state, command, duration_s)

    def _stand(self) -> None:
        """No lower than the ground, and there at rest."""
        if self.position_world_m[2] > self.ground_m:
            return
        self.state[0, 2] = self.ground_m - self.carried_m[2]
        if self.velocity_world_m_s[2] <= 0.0:
            self.state[0, 3:6], self.state[0, 6:10], self.state[0, 10:13] = -self.air_m_s, LEVEL, 0.0

    def _blow(self, duration_s: float) -> None:
        """Other air: what flies keeps its velocity in the world."""
        through_m_s = float(np.linalg.norm(self.velocity_world_m_s - self.mean_m_s))
        self.way_m += duration_s * max(through_m_s, SLOWEST_M_S)
        new = self.mean_m_s + self.gusts.at(self.way_m)
        self.state[0, 3:6] += self.air_m_s - new
        self.air_m_s = new


def unlike_the_drawing() -> flying.Truth:
    """The tests' vehicle with thrust, drag, lag and inertia that nobody told a model of."""
    usual = flying.Truth()
    inertia = tuple(ratio * axis for ratio, axis in zip((1.1, 0.95, 1.05), usual.inertia, strict=True))
    return replace(
        usual, k1=1.02 * usual.k1, drag_xy=1.4 * usual.drag_xy, rotor_drag=0.85 * usual.rotor_drag, inertia=inertia,
        sensor=(0.0, 0.0, 0.0),
    )  # fmt: skip
