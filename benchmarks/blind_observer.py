"""Blind campaigns flown by the embedded controller with its disturbance observer on, and the same ones with it off.

    python benchmarks/blind_observer.py FOLDER [--seed S] [--hide NAME ...]

Vehicles, hidden effects, gusts and sensors are those of `blind_campaigns`; the paths are its sines, begun and ended at
rest. A controller that cancels a disturbance must not hide its cause from the diagnosis: as many right names with the
observer on as with it off. `FOLDER/on` and `FOLDER/off` are kept; what was diagnosed already is not diagnosed again.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import blind_campaigns
import diagnosis_run
import numpy as np
from blind_campaigns import FLIGHTS, LOG_EVERY, STEP_S, Recording, answers, measure, vehicle_file
from blind_draw import Conditions, Truth, draw
from blind_flight import (
    ATTITUDE,
    GRAVITY_M_S2,
    ROTORS,
    VELOCITY,
    Array,
    Fleet,
    Sky,
    advance,
    matrix,
    slope,
    turned_back,
)
from blind_manoeuvres import TRAINING, Paths
from blind_manoeuvres import Path as Sines
from blind_manoeuvres import draw as draw_path
from diagnosis import names

import vehicle
from firmware_bridge import Sensors, controller
from firmware_bridge.controller import Command, Controller, State
from flight import FlightLog, Trajectory, file_format, flight_log
from sysid.diagnosis import diagnose

HIDE = (
    "constant_wind", "rotor_drag_thrust", "parasitic_drag", "centre_of_mass", "weak_rotor", "translational_lift",
    "flapping_moment", "angular_damping", "payload", "",
)  # fmt: skip
"""One campaign each; the last hides nothing."""
RAMP_S, SEGMENT_S = 3.0, 0.5
HELD_S, HOVER_S = 2.0, 2.5
"""Held in the air until the controller has taken over; hovering then, the time of both included."""
ON_PATH_S = 16.0
"""Steady flight that is recorded."""
OBSERVED = ("disturbance_force_world_n", "disturbance_torque_body_n_m", "disturbance_torque_std_n_m")


def course(sines: Sines) -> Trajectory:
    """A path of `blind_manoeuvres` from rest to rest: its time is slowed at both ends."""
    paths, total_s = Paths.of([sines]), ON_PATH_S + 2.0 * RAMP_S
    count = round(total_s / SEGMENT_S)
    nodes = np.cos(np.pi * (np.arange(24) + 0.5) / 24)
    coefficients = np.zeros((count, 4, 10))
    for i in range(count):
        t = SEGMENT_S * (i + 0.5 * (nodes + 1.0))
        points = [paths.at(_slowed(x, total_s)) for x in t]
        rows = np.array([[*p.position[:, 0], p.yaw[0]] for p in points])
        for axis in range(4):
            fit = np.polynomial.Polynomial.fit(t - SEGMENT_S * i, rows[:, axis], 9).convert().coef
            coefficients[i, axis, : len(fit)] = fit
    return Trajectory(np.full(count, SEGMENT_S), coefficients)


def _slowed(t: float, total_s: float) -> float:
    """Time on the sines: at rest, then at their own pace, then at rest."""

    def ramp(u: float) -> float:
        v = min(max(u, 0.0), 1.0)
        return 7 * v**5 - 14 * v**6 + 10 * v**7 - 2.5 * v**8 + max(u - 1.0, 0.0)

    return RAMP_S * (ramp(t / RAMP_S) - ramp((t - total_s + RAMP_S) / RAMP_S))


class Pilot:
    """One controller on one of the flights, in the air from the beginning."""

    def __init__(self, model: vehicle.Vehicle, path: Trajectory, observer: bool, seed: list[int]) -> None:
        setup = controller.parameters_of(model, observer=float(observer))
        self.controller, self.path, self.sensors = Controller(setup), path, Sensors.typical()
        self.rng = np.random.default_rng(seed)
        self.past: list[Array] = []

    def command(self, i: int, state: Array, force: Array) -> Array:
        truth = np.concatenate([state[0:6], np.roll(state[ATTITUDE], 1), state[10:13]])
        self.past = [*self.past, truth][-5:]  # 10 ms
        late = np.concatenate([self.past[0][:10], truth[10:]])
        now_us = round((i + 1) * STEP_S * 1e6)
        pose_us = now_us - round((len(self.past) - 1) * STEP_S * 1e6)
        if i == 4:
            self.controller.shadow()
        if i == round(HELD_S / STEP_S):
            self.controller.engage(state[ROTORS])
            self.controller.upload(self.path, clearance_m=10.0)
        if i == round(HOVER_S / STEP_S):
            self.controller.command(Command.START)
        return self.controller.tick(
            now_us,
            self.sensors.estimate(late, self.rng),
            position_time_us=pose_us,
            attitude_time_us=pose_us,
            specific_force_body_m_s2=force + self.rng.normal(0.0, self.sensors.specific_force_std_m_s2, 3),
            rotor_speed_rad_s=state[ROTORS] + self.rng.normal(0.0, self.sensors.rotor_speed_std_rad_s, 4),
        )


def fly(truth: Truth, model: vehicle.Vehicle, observer: bool, seed: list[int]) -> tuple[list[Recording], list[Any]]:
    """All flights of one campaign, at once, and what the observer found at each row."""
    rng = np.random.default_rng(seed)
    sines = [draw_path(kind, truth.low, rng) for kind in FLIGHTS]
    pilots = [Pilot(model, course(one), observer, [*seed, j]) for j, one in enumerate(sines)]
    fleet = Fleet.of([blind_campaigns._body(truth, j) for j in range(len(FLIGHTS))])
    sky = Sky(tuple((slice(0, len(FLIGHTS)), extra) for extra in truth.extras))
    begin, steps = HOVER_S + RAMP_S, round((HOVER_S + 2.0 * RAMP_S + ON_PATH_S + 0.5) / STEP_S)
    wind = np.stack([blind_campaigns._gusts(truth, steps, rng) for _ in FLIGHTS], axis=-1)
    state = np.zeros((17, len(FLIGHTS)))
    state[:3] = np.stack([pilot.path.position([0.0])[0] for pilot in pilots], axis=-1)
    yaw = np.array([pilot.path.evaluate([0.0])[0, 3] for pilot in pilots])
    state[8], state[9] = np.sin(0.5 * yaw), np.cos(0.5 * yaw)
    state[ROTORS] = np.sqrt(fleet.mass * GRAVITY_M_S2 / (4.0 * fleet.thrust))
    rows, forces, commands, targets, times, found = [], [], [], [], [], []
    command = state[ROTORS]
    for i in range(steps):
        t = i * STEP_S
        pull = slope(fleet, state, command, wind[i], t, sky)[VELOCITY]
        pull[2] += GRAVITY_M_S2
        force = turned_back(matrix(state[ATTITUDE]), pull)
        command = np.stack([p.command(i, state[:, j], force[:, j]) for j, p in enumerate(pilots)], axis=-1)
        if begin <= t < begin + ON_PATH_S and i % LOG_EVERY == 0:
            told = [pilot.controller.telemetry for pilot in pilots]
            rows.append(state)
            forces.append(force)
            commands.append(command)
            times.append(t - begin)
            targets.append(np.stack([one["setpoint"]["position_world_m"] for one in told], axis=-1))
            found.append(told)
        if t < HELD_S:
            command = state[ROTORS]
        else:
            state = advance(fleet, state, command, wind[i], t, STEP_S, sky)
    _require_flown(pilots)
    both = [np.stack(x) for x in (rows, forces, commands, targets)]
    made = [Recording(one.kind, np.array(times), *(x[..., j] for x in both)) for j, one in enumerate(sines)]
    return made, [[one[j] for one in found] for j in range(len(FLIGHTS))]


def _require_flown(pilots: list[Pilot]) -> None:
    for pilot in pilots:
        if pilot.controller.state not in (State.TRAJECTORY, State.HOLD):
            raise SystemExit(f"a flight ended in {pilot.controller.state.name}")


def write(out: Path, hide: str, seed: int) -> None:
    """One campaign twice, in `out/on` and `out/off`."""
    kind = "single" if hide else "none"
    name = hide or "nothing"
    key = [seed, len(name), *name.encode()]
    truth = draw(kind, np.random.default_rng(key), Conditions(), [hide] if hide else ())
    model = vehicle_file(truth, name, np.random.default_rng([*key, 1]))
    for observer in (True, False):
        folder = out / ("on" if observer else "off") / name
        if (folder / "manifest.toml").exists():
            continue
        made, told = fly(truth, model, observer, [*key, 2])
        noise, files = np.random.default_rng([*key, 3]), []
        (folder / "flights").mkdir(parents=True, exist_ok=True)
        (folder.parent / "truth").mkdir(exist_ok=True)
        for j, recording in enumerate(made):
            files.append(f"flights/{j}_{recording.kind}.parquet")
            log = measure(recording, truth, j in blind_campaigns.LOADED, noise)
            flight_log.save(folder / files[-1], _observed(log, told[j]) if observer else log)
        vehicle.save(folder / "vehicle.toml", model)
        split = len(TRAINING)
        body = {"vehicle": "vehicle.toml", "training": files[:split], "held_out": files[split:]}
        file_format.write_toml(folder / "manifest.toml", format="goshawk-blind-campaign", version=1, body=body)
        checks = [one.check(truth.body["rotor_speed_max"]) for one in made]
        told_truth = answers(truth, key, checks, model.mass_kg)
        (folder.parent / "truth" / f"{name}.json").write_text(json.dumps(told_truth, indent=1) + "\n")
        print(folder, "worst position error", f"{max(c['worst_position_error_m'] for c in checks):.3f} m", flush=True)


def _observed(log: FlightLog, told: list[Any]) -> FlightLog:
    vectors = {name: np.array([one[name] for one in told], dtype=np.float64) for name in OBSERVED}
    scalars = {n: np.array([float(one[n]) for one in told]) for n in ("disturbance_force_std_n", "observer_state")}
    more = flight_log.from_vectors(log.time_s, vectors, scalars=scalars)
    return FlightLog({**log.columns, **more.columns}, log.metadata)


def results(out: Path, hidden: list[str]) -> dict[str, dict[str, Any]]:
    """Diagnosed or read: by `on` and `off`, by campaign."""
    found: dict[str, dict[str, Any]] = {"on": {}, "off": {}}
    for hide in hidden:
        for part, kept in found.items():
            file = out / part / f"{hide or 'nothing'}.json"
            if not file.exists():
                file.write_text(json.dumps(_diagnosed(out / part / (hide or "nothing"))) + "\n")
            kept[hide] = json.loads(file.read_text())
            one = kept[hide]["diagnosis"]
            print(
                part,
                hide or "nothing",
                "->",
                names(kept[hide]),
                f"{one['confidence']:.0%}",
                f"{one['cpu_s']:.0f} CPU s",
                flush=True,
            )
    return found


def _diagnosed(folder: Path) -> dict[str, Any]:
    training, held_out, given = diagnosis_run.load(folder)
    begun_s = time.process_time()
    stated = diagnosis_run.stated(diagnose(training, given, held_out=held_out, auto=True))
    return {"diagnosis": {"cpu_s": time.process_time() - begun_s, **stated}}


def is_right(result: dict[str, Any], hide: str) -> bool:
    """All names that were hidden, no other and no unknown curve."""
    return names(result) == ([hide] if hide else []) and result["diagnosis"]["outside"] is None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--hide", nargs="*", default=list(HIDE), help="effects to hide, a campaign each")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only-fly", action="store_true")
    a = parser.parse_args()
    for hide in a.hide:
        write(a.out, hide, a.seed)
    if a.only_fly:
        return
    found = results(a.out, a.hide)
    for part, kept in found.items():
        print(f"observer {part}: {sum(is_right(r, hide) for hide, r in kept.items())} of {len(kept)} right")


if __name__ == "__main__":
    main()
