"""Flights with nothing wrong but the weather: how often the monitor doubts a pose that is true.

    python benchmarks/good_flights.py --flights 2000

Each flight draws wind to 9 m/s, gusts, vibration, mass, rotors, a late pose and a path, gentle or aggressive, in the
body that shares no code with the controller. An alarm is dead reckoning, or a pose that is not believed.
"""

import argparse
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "firmware_bridge" / "failsafe"))

import controller_worlds
import harness
from scenario import FROM_START, START, TAKE_OFF, Curve, Fault, Kind, Reason, Scenario, State, circle, land

DEAD_RECKONING = 1 << 1
"""`TC_WARNING_DEAD_RECKONING`."""
LARGEST_ACCELERATION_M_S2 = 12.0
CLEARANCE_M = 0.5


@dataclass(frozen=True, slots=True)
class Flown:
    alarms: tuple[str, ...]
    finished: bool
    landed: bool


def draw_path(rng: np.random.Generator) -> Curve:
    """The benchmark's slalom, or a circle at up to 8 m/s and 12 m/s2."""
    if rng.random() < 0.3:
        return controller_worlds.path()
    speed_m_s = float(rng.uniform(1.0, 8.0))
    tightest_m = max(speed_m_s**2 / LARGEST_ACCELERATION_M_S2, 1.0)
    return circle(speed_m_s, radius_m=float(rng.uniform(1.0, 2.0)) * tightest_m, clearance_m=CLEARANCE_M)


def draw(seed: int) -> Scenario:
    rng = np.random.default_rng(seed)
    path, angle, wind_m_s = draw_path(rng), rng.uniform(-np.pi, np.pi), rng.uniform(0.0, 9.0)
    late_s = float(rng.choice([0.0, rng.uniform(0.0, 0.03)]))
    faults = [Fault(Kind.STAMP_OFFSET, (late_s,), since=FROM_START)]
    faults += [Fault(Kind.ROTOR_HEALTH, (i, float(rng.uniform(0.93, 1.05))), since=FROM_START) for i in range(4)]
    return Scenario(
        orders=(*TAKE_OFF, START, land(path.duration_s + 2.0, State.TRAJECTORY)),
        faults=tuple(faults),
        path=path,
        parameters={"rotor_lag_s": 0.03},
        vehicle={"mass_kg": 0.7 * float(rng.uniform(0.97, 1.05))},
        world={
            "wind_m_s": (wind_m_s * np.cos(angle), wind_m_s * np.sin(angle), 0.0),
            "gust_std_m_s": float(rng.uniform(0.0, 1.5)),
        },
        sensors={
            "delay_s": 0.01 + late_s,
            "vibration_m_s2": float(rng.choice([1.0, 3.0, 6.0])),
            "gyro_noise_rad_s": float(rng.uniform(0.01, 0.05)),
        },
        seed=seed,
        limit_s=90.0,
    )


def fly(seed: int) -> Flown:
    result = harness.load().fly(draw(seed), trace_every=20)  # what is not believed is not for half a second
    alarms = [Reason(change.reason).name for change in result.changes if "POSE" in Reason(change.reason).name]
    flies = result.trace["state"] >= State.TAKE_OFF
    if (result.trace["warnings"][flies].astype(int) & DEAD_RECKONING).any():
        alarms.append("DEAD_RECKONING")
    return Flown(tuple(alarms), any(change.reason == Reason.FINISHED for change in result.changes), result.at_rest)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0, help="of the first flight")
    args = parser.parse_args()
    flown = {seed: fly(seed) for seed in range(args.seed, args.seed + args.flights)}
    alarmed = {seed: f.alarms for seed, f in flown.items() if f.alarms}
    print(f"{len(flown)} flights, {sum(f.finished for f in flown.values())} to the path's end")
    print(f"{sum(f.landed for f in flown.values())} landed, {len(alarmed)} with an alarm")
    for alarm, number in Counter(a for alarms in alarmed.values() for a in set(alarms)).items():
        print(f"{number:6}  {alarm}, first in flight {next(s for s, a in alarmed.items() if alarm in a)}")


if __name__ == "__main__":
    main()
