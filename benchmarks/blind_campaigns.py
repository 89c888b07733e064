"""Flights of vehicles whose file lacks an effect, with ground truth in another folder: test data for the diagnosis.

    python benchmarks/blind_campaigns.py --out FOLDER [--kind all|single|pair|none|outside|foreign|form]
        [--count N] [--seed S]

RotorPy's equations fly them (`blind_flight`), with gusts, its own controller, and what it lacks from `blind_truth`.
Each campaign is a folder with `vehicle.toml`, `manifest.toml` and four training and two held-out flights in Parquet;
what is hidden stands in `FOLDER/truth/` under the same name. Two thirds fly in gusts, of a third the clock of the rotor
speeds is off by up to 8 ms, and a sixth hold commands in place of rotor speed. New campaigns are numbered after those
already there.
"""

import argparse
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from blind_draw import BATTERY_V, KINDS, PAYLOAD_Z_M, Conditions, Truth, draw
from blind_flight import (
    ATTITUDE,
    GRAVITY_M_S2,
    POSITION,
    RATE,
    ROTORS,
    VELOCITY,
    Array,
    Fleet,
    Reference,
    Sky,
    advance,
    demanded_force_per_mass,
    matrix,
    se3_command,
    slope,
    turned_back,
    upright,
)
from blind_manoeuvres import HELD_OUT, TRAINING, Paths
from blind_manoeuvres import draw as draw_path
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

import vehicle
from flight import FlightLog, file_format, flight_log, rotations

FLIGHTS = (*TRAINING, *HELD_OUT)
LOADED = (1, 3, 5)
"""Flights that carry the payload, when there is one: the second and fourth, and the second held out."""
STEP_S = 0.0025
LOG_EVERY = 2
"""Steps between rows of the log: 200 Hz."""
SETTLE_S = 1.0
"""The log starts once the controller has caught the path."""
BATCH = 8
"""Campaigns flown at once."""
SHARES = {"single": 0.2, "pair": 0.12, "none": 0.17, "outside": 0.12, "foreign": 0.06, "form": 0.33}
"""What `--kind all` is made of."""
GUSTS, OFFSETS, COMMANDS = 2 / 3, 1 / 3, 1 / 6
"""Shares of the campaigns with gusts, with a clock that is off, with commands alone."""

POSITION_NOISE_M, ATTITUDE_NOISE_RAD, ROTOR_NOISE_RAD_S = 2e-3, np.deg2rad(0.12), 4.0
GYRO_NOISE_RAD_S, GYRO_BIAS_RAD_S, FORCE_NOISE_M_S2, FORCE_BIAS_M_S2 = 0.01, 0.02, 0.3, 0.15
BATTERY_NOISE_V = 0.02
FILE_ERROR = 0.05
"""Relative standard deviation of the vehicle file's numbers; the mass is right to `MASS_ERROR`."""
MASS_ERROR = 0.01


@dataclass(frozen=True, slots=True)
class Recording:
    """Ground truth of one flight, from the start of the log."""

    kind: str
    time_s: Array
    state: Array
    """(n, 17)."""
    specific_force: Array
    """(n, 3) in body axes."""
    command: Array
    """(n, 4) rotor speeds asked for."""
    setpoint: Array
    """(n, 3)."""

    def check(self, most_speed: float) -> dict[str, float]:
        """Figures that show the flight is one: it tracks, stays above ground, keeps within the motors' limits."""
        error = np.linalg.norm(self.state[:, POSITION] - self.setpoint, axis=1)
        return {
            "worst_position_error_m": float(error.max()),
            "lowest_m": float(self.state[:, 2].min()),
            "most_speed_m_s": float(np.linalg.norm(self.state[:, VELOCITY], axis=1).max()),
            "least_rotor_rad_s": float(self.state[:, ROTORS].min()),
            "most_rotor_share": float(self.state[:, ROTORS].max() / most_speed),
        }


def sound(figures: dict[str, float]) -> bool:
    """Whether a flight passes its check; NaN does not."""
    tracks = figures["worst_position_error_m"] < WORST_ERROR_M and figures["lowest_m"] > 0.05
    return tracks and figures["least_rotor_rad_s"] > 40.0 and figures["most_rotor_share"] < 0.98


WORST_ERROR_M = 1.0
ATTEMPTS = 10
"""Draws until a campaign of sound flights must have been found."""


def fly(
    truths: list[Truth], rngs: list[np.random.Generator], duration_s: float, every: int = LOG_EVERY
) -> list[list[Recording]]:
    """All flights of several campaigns, at once; `every` so many steps are recorded."""
    paths = [draw_path(k, t.low, g) for t, g in zip(truths, rngs, strict=True) for k in FLIGHTS]
    fleet = Fleet.of([_body(t, i) for t in truths for i in range(len(FLIGHTS))])
    believed = Fleet.of([t.body for t in truths for _ in FLIGHTS])
    width = len(FLIGHTS)
    sky = Sky(tuple((slice(width * i, width * (i + 1)), e) for i, t in enumerate(truths) for e in t.extras))
    steps = round((duration_s + SETTLE_S) / STEP_S) + 1
    gusts = [_gusts(t, steps, g) for t, g in zip(truths, rngs, strict=True) for _ in FLIGHTS]
    wind = np.stack(gusts, axis=-1)
    reference = Paths.of(paths)
    state = _start(reference.at(0.0), believed)
    rows, forces, commands, targets, times = [], [], [], [], []
    sag = np.array([t.sag_per_v * t.drop_v for t in truths for _ in FLIGHTS])
    for i in range(steps):
        t = i * STEP_S
        target = reference.at(t)
        command = np.clip(np.nan_to_num(se3_command(believed, state, target)), fleet.least_speed, fleet.most_speed)
        reached = command * (1.0 - sag * max(0.0, t - SETTLE_S) / duration_s)
        if t >= SETTLE_S - 1e-9 and i % every == 0:
            pull = slope(fleet, state, reached, wind[i], t, sky)[VELOCITY]
            pull[2] += GRAVITY_M_S2
            forces.append(turned_back(matrix(state[ATTITUDE]), pull))
            rows.append(state)
            commands.append(command)
            targets.append(target.position)
            times.append(t - SETTLE_S)
        with np.errstate(all="ignore"):  # one that crashes is found by its check
            state = advance(fleet, state, reached, wind[i], t, STEP_S, sky)
    both = [np.stack(x) for x in (rows, forces, commands, targets)]
    made = [Recording(p.kind, np.array(times), *(x[..., j] for x in both)) for j, p in enumerate(paths)]
    return [made[width * i : width * (i + 1)] for i in range(len(truths))]


def _body(truth: Truth, flight: int) -> dict[str, Any]:
    """RotorPy's parameters of one flight: with the payload's point mass, if it is carried."""
    body, added = dict(truth.body), truth.payload_kg
    if added == 0.0 or flight not in LOADED:
        return body
    mass = body["mass"]
    down = PAYLOAD_Z_M * added / (mass + added)
    reduced = mass * added / (mass + added) * PAYLOAD_Z_M**2
    body["rotor_pos"] = {n: r - [0.0, 0.0, down] for n, r in body["rotor_pos"].items()}
    return body | {"mass": mass + added, "Ixx": body["Ixx"] + reduced, "Iyy": body["Iyy"] + reduced}


def _gusts(truth: Truth, steps: int, rng: np.random.Generator) -> Array:
    """(steps, 3) wind: its mean, and noise through two low-pass filters, gentler along the vertical."""
    slow, fast = np.exp(-STEP_S / rng.uniform(0.4, 1.2)), np.exp(-STEP_S / 0.08)
    burn = round(6.0 / STEP_S)
    noise = rng.standard_normal((steps + burn, 3))
    smooth = lfilter([1.0 - fast], [1.0, -fast], lfilter([1.0 - slow], [1.0, -slow], noise, axis=0), axis=0)[burn:]
    # standard deviation of white noise after both filters
    gain = (1 - slow) ** 2 * (1 - fast) ** 2 * (1 + slow * fast)
    size = np.sqrt(gain / ((1 - slow**2) * (1 - fast**2) * (1 - slow * fast)))
    return np.array(truth.wind_m_s) + smooth / size * truth.gust_m_s * [1.0, 1.0, 0.5]


def _start(target: Reference, believed: Fleet) -> Array:
    """On the path, thrust where the path bends, heading as given."""
    state = np.zeros((17, believed.mass.size))
    state[POSITION], state[VELOCITY] = target.position, target.velocity
    pull = demanded_force_per_mass(state, target)
    state[ATTITUDE] = Rotation.from_matrix(np.moveaxis(upright(pull, target.yaw), 2, 0)).as_quat().T
    state[ROTORS] = np.sqrt(believed.mass * np.linalg.norm(pull, axis=0) / (4.0 * believed.thrust))
    return state


def measure(recording: Recording, truth: Truth, loaded: bool, rng: np.random.Generator) -> FlightLog:
    """The sensors' log."""
    n, time_s, state = len(recording.time_s), recording.time_s, recording.state
    arm = np.array(truth.sensor_m)
    if loaded:
        arm = arm - [0.0, 0.0, PAYLOAD_Z_M * truth.payload_kg / (truth.body["mass"] + truth.payload_kg)]
    q = np.roll(state[:, ATTITUDE], 1, axis=1)
    seen = time_s - truth.delay_s
    old_q = rotations.normalise(CubicSpline(time_s, q)(seen))
    old_place = CubicSpline(time_s, state[:, POSITION])(seen) + rotations.rotate(old_q, arm)
    turn = rotations.multiply(old_q, rotations.exp(np.array(truth.sensor_turn_rad)))
    vectors = {
        "position_world_m": old_place + POSITION_NOISE_M * rng.standard_normal((n, 3)),
        "q_world_body": rotations.multiply(turn, rotations.exp(ATTITUDE_NOISE_RAD * rng.standard_normal((n, 3)))),
        "rate_body_rad_s": state[:, RATE]
        + GYRO_BIAS_RAD_S * rng.standard_normal(3)
        + GYRO_NOISE_RAD_S * rng.standard_normal((n, 3)),
        "specific_force_body_m_s2": recording.specific_force
        + FORCE_BIAS_M_S2 * rng.standard_normal(3)
        + FORCE_NOISE_M_S2 * rng.standard_normal((n, 3)),
        **_rotors(recording, truth, rng),
        "setpoint_position_world_m": recording.setpoint,
    }
    scalars = None
    if truth.commands_only:
        drop_v = truth.drop_v * time_s / time_s[-1]
        scalars = {"battery_v": BATTERY_V - drop_v + BATTERY_NOISE_V * rng.standard_normal(n)}
    metadata = {"name": recording.kind, "source": "RotorPy"}
    return flight_log.from_vectors(time_s, vectors, scalars=scalars, metadata=metadata)


def _rotors(recording: Recording, truth: Truth, rng: np.random.Generator) -> dict[str, Array]:
    """What the log knows of the rotors: their speed, or the command alone; stamped too late or too early."""
    time_s = recording.time_s
    seen = np.clip(time_s - truth.rotor_late_s, time_s[0], time_s[-1])
    if not truth.commands_only:
        speed = CubicSpline(time_s, recording.state[:, ROTORS])(seen)
        return {"rotor_speed_rad_s": speed + ROTOR_NOISE_RAD_S * rng.standard_normal(speed.shape)}
    command = np.stack([np.interp(seen, time_s, column) for column in recording.command.T], axis=1)
    return {"rotor_speed_command_rad_s": command}


def vehicle_file(truth: Truth, name: str, rng: np.random.Generator) -> vehicle.Vehicle:
    """The vehicle file for the diagnosis: the known effects, every value with a small error."""
    body = truth.body
    v = vehicle.example("hummingbird")
    for effect in ("motor_lag", "inflow_linear", "translational_lift", "rotor_drag_speed", "parasitic_drag_speed"):
        v = v.without_effect(effect)
    hubs = np.stack(list(body["rotor_pos"].values())) + np.array([*truth.centre_m, 0.0])
    v = replace(v, name=name, hub_body_m=hubs, spin=-np.asarray(body["rotor_directions"], float))
    v = replace(v, provenance={"note": "a blind campaign; values from a data sheet"})
    for effect, values in _known_values(truth).items():
        v = v.with_effect(effect, source="data sheet", **values)
    sizes = {f"inertia_{axis}_kg_m2": body["I" + axis] for axis in ("xx", "yy", "zz")}
    sizes |= {"thrust_quadratic.k_n_s2": body["k_eta"], "rotor_yaw_torque.torque_n_m_s2": body["k_m"]}
    sizes |= {f"{e}.{p}": x for e, values in _known_values(truth).items() for p, x in values.items()}
    for parameter, value in sizes.items():
        wrong = value * (1.0 + FILE_ERROR * rng.standard_normal())
        v = v.with_value(parameter, wrong, std=FILE_ERROR * abs(value), source="data sheet")
    mass = body["mass"] * (1.0 + MASS_ERROR * rng.standard_normal())
    v = v.with_value("mass_kg", mass, std=MASS_ERROR * mass, source="kitchen scale")
    for axis, place in zip("xyz", truth.sensor_m, strict=True):
        measured = place + 0.003 * rng.standard_normal()
        v = v.with_value(f"pose_sensor_{axis}_m", measured, std=0.003, source="ruler")
    return v


def _known_values(truth: Truth) -> dict[str, dict[str, float]]:
    body = truth.body
    thrust_share = body["k_d"] * 4.0 / np.sqrt(body["mass"] * GRAVITY_M_S2 / 4.0 / body["k_eta"]) / body["k_eta"] / 4.0
    values = {
        "inflow_linear": {"inflow_kg": body["k_z"]},
        "translational_lift": {"lift_kg_m": body["k_h"]},
        "rotor_drag_speed": {"drag_kg": body["k_d"] or 6e-5},
        "parasitic_drag_speed": {f"drag_{axis}_kg_m": body[f"c_D{axis}"] or 5e-3 for axis in "xyz"},
        "flapping_moment": {"moment_kg_m": body["k_flap"]},
        "centre_of_mass": dict(zip(("x_m", "y_m"), truth.centre_m, strict=True)),
        "motor_lag": {"rise_s": body["tau_m"], "fall_s": body["tau_m"]},
        # only ever believed: about what the true form amounts to
        "rotor_drag_thrust": {"drag_s_m": thrust_share or 0.02},
        "parasitic_drag": {"drag_xy_kg_m": body["c_Dx"] or 5e-3, "drag_z_kg_m": body["c_Dz"] or 1e-2},
    }
    return {name: values[name] for name in values if name in truth.known or name in truth.believed}


def answers(truth: Truth, seed: list[int], checks: list[dict[str, float]], file_mass_kg: float) -> dict[str, Any]:
    """The truth file."""
    return {
        "format": "goshawk-blind-truth",
        "version": 1,
        "kind": truth.kind,
        "seed": seed,
        "hidden": truth.hidden,
        "real_drag": truth.real,
        "believed_drag": truth.believed,
        # the IMU is biased in every campaign: naming that is correct
        "tolerated": ["imu_errors", *truth.real, *truth.near],
        "near": truth.near,
        "channels": truth.channels,
        "variables": truth.variables,
        "law": truth.law,
        "mass_kg": truth.body["mass"],
        "file_mass_kg": file_mass_kg,
        "known": sorted(truth.known),
        "rotorpy": {k: x for k, x in truth.body.items() if isinstance(x, int | float)},
        "wind_m_s": list(truth.wind_m_s),
        "gust_m_s": truth.gust_m_s,
        "rotor_late_s": truth.rotor_late_s,
        "commands_only": truth.commands_only,
        "low": truth.low,
        "flights": dict(zip(FLIGHTS, checks, strict=True)),
    }


def write(out: Path, name: str, truth: Truth, made: list[Recording], seed: list[int], rng: np.random.Generator) -> None:
    """One campaign's folder, and its truth beside it."""
    folder = out / name
    (folder / "flights").mkdir(parents=True, exist_ok=True)
    (out / "truth").mkdir(exist_ok=True)
    files = []
    for i, recording in enumerate(made):
        files.append(f"flights/{i}_{recording.kind}.parquet")
        flight_log.save(folder / files[-1], measure(recording, truth, i in LOADED, rng))
    model = vehicle_file(truth, name, rng)
    vehicle.save(folder / "vehicle.toml", model)
    split = len(TRAINING)
    body = {"vehicle": "vehicle.toml", "training": files[:split], "held_out": files[split:]}
    file_format.write_toml(folder / "manifest.toml", format="goshawk-blind-campaign", version=1, body=body)
    checks = [r.check(truth.body["rotor_speed_max"]) for r in made]
    found = answers(truth, seed, checks, model.mass_kg)
    (out / "truth" / f"{name}.json").write_text(json.dumps(found, indent=1) + "\n")


def generate(out: Path, kinds: list[str], seed: int, duration_s: float = 36.0) -> list[str]:
    """Draw, fly and write campaigns; one whose flights do not pass their check is drawn again."""
    first = 1 + max((int(p.stem.split("_")[1]) for p in out.glob("campaign_*")), default=-1)
    waiting = [(f"campaign_{first + i:03d}", kind, [seed, KINDS.index(kind), i, 0]) for i, kind in enumerate(kinds)]
    drawn = conditions(len(kinds), np.random.default_rng([seed, 1]))  # not the generator that ordered the kinds
    how = dict(zip((name for name, _, _ in waiting), drawn, strict=True))
    done = []
    while waiting:
        batch, waiting = waiting[:BATCH], waiting[BATCH:]
        rngs = [np.random.default_rng(key) for _, _, key in batch]
        truths = [draw(kind, rng, how[name]) for (name, kind, _), rng in zip(batch, rngs, strict=True)]
        for (name, kind, key), truth, made, rng in zip(batch, truths, fly(truths, rngs, duration_s), rngs, strict=True):
            checks = [r.check(truth.body["rotor_speed_max"]) for r in made]
            if all(sound(c) for c in checks):
                write(out, name, truth, made, key, rng)
                done.append(name)
                worst = max(c["worst_position_error_m"] for c in checks)
                print(f"{name}: flown, worst position error {worst:.2f} m", flush=True)
            elif key[3] + 1 == ATTEMPTS:
                raise SystemExit(f"{name}: no sound flights in {ATTEMPTS} draws, the last: {checks}")
            else:
                waiting.append((name, kind, [*key[:3], key[3] + 1]))
    return done


def mixture(count: int, rng: np.random.Generator) -> list[str]:
    """Kinds in the shares of `SHARES`, in random order."""
    exact = np.cumsum([SHARES[k] * count for k in KINDS])
    marks = np.diff(np.round(np.concatenate([[0.0], exact])).astype(int))
    kinds = [k for k, n in zip(KINDS, marks, strict=True) for _ in range(n)]
    return [str(k) for k in rng.permutation(kinds)]


def conditions(count: int, rng: np.random.Generator) -> list[Conditions]:
    """How each of so many campaigns is flown and recorded, in the shares above, independent of its kind."""

    def some(share: float) -> Array:
        return rng.permutation(np.arange(count) < round(share * count))

    drawn = zip(some(GUSTS), some(OFFSETS), some(COMMANDS), strict=True)
    return [Conditions(bool(gusts), bool(offset), bool(commands)) for gusts, offset, commands in drawn]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--kind", choices=(*KINDS, "all"), default="all")
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    a = parser.parse_args()
    a.out.mkdir(parents=True, exist_ok=True)
    kinds = mixture(a.count, np.random.default_rng(a.seed)) if a.kind == "all" else [a.kind] * a.count
    generate(a.out, kinds, a.seed)


if __name__ == "__main__":
    main()
