"""Plans in the Crazyflie's memory: near the plan by an evaluator of our own and by the firmware's, or refused."""

import csv
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from flight import FloatArray, InputError, Trajectory
from goshawk.commands.plan import formats, poly4d
from tests.firmware_bridge.conftest import fitted

FIRMWARE = "CRAZYFLIE_BASE"
"""Folder of crazyflie-firmware's sources, as its own makefiles call it."""
HARNESS = """
#include <stdio.h>
#include "pptraj.h"
static struct poly4d pieces[31];
int main(void) {
    int n, times;
    if (scanf("%d %d", &n, &times) != 2) return 1;
    for (int i = 0; i < n; i++) {
        if (scanf("%f", &pieces[i].duration) != 1) return 1;
        for (int k = 0; k < 32; k++) if (scanf("%f", &pieces[i].p[k / 8][k % 8]) != 1) return 1;
    }
    struct piecewise_traj traj = {.timescale = 1.0f, .n_pieces = (unsigned char)n, .pieces = pieces};
    for (int i = 0; i < times; i++) {
        float t;
        if (scanf("%f", &t) != 1) return 1;
        struct traj_eval at = piecewise_eval(&traj, t);
        printf("%.9g %.9g %.9g %.9g\\n", at.pos.x, at.pos.y, at.pos.z, at.yaw);
    }
}
"""


def walk(segments: int, *, laps: float = 2.0) -> Trajectory:
    """A closed curve of many short segments of degree 11, which turns its heading too."""

    def curve(t: FloatArray) -> FloatArray:
        a = 2.0 * np.pi * laps * np.asarray(t) / (0.25 * segments)
        return np.stack([3.0 * np.cos(a), 2.0 * np.sin(2.0 * a), 1.5 + 0.4 * np.sin(3.0 * a), np.sin(a)], axis=-1)

    return fitted(curve, np.full(segments, 0.25))


def rows_of(path: Path) -> FloatArray:
    rows = list(csv.reader(path.read_text().splitlines()))
    return np.array([[float(cell) for cell in row] for row in rows[1:]])


def as_the_firmware(rows: FloatArray, times_s: FloatArray) -> FloatArray:
    """(n, 4) by Horner's rule in single precision, the pieces walked through one after the other."""
    numbers = rows.astype(np.float32)
    found = []
    for t in times_s.astype(np.float32):
        piece = 0
        while piece < len(numbers) - 1 and t > numbers[piece, 0]:
            t -= numbers[piece, 0]
            piece += 1
        values = np.zeros(4, np.float32)
        for power in range(7, -1, -1):
            values = values * min(t, numbers[piece, 0]) + numbers[piece, 1:].reshape(4, 8)[:, power]
        found.append(values)
    return np.array(found, dtype=np.float64)


def farthest_m(flown: FloatArray, plan: Trajectory, times_s: FloatArray) -> float:
    return float(np.linalg.norm(flown[:, :3] - plan.position(times_s), axis=1).max())


def test_a_plan_of_two_hundred_segments_fits_and_stays_within_a_centimetre(tmp_path):
    plan = walk(200)
    held = formats.write_crazyflie(tmp_path / "w.csv", plan)
    rows = rows_of(tmp_path / "w.csv")
    assert rows.shape == (len(held.trajectory.durations_s), 33)
    assert len(rows) <= 31
    times = plan.sample(0.01)
    flown = as_the_firmware(rows, times)
    assert farthest_m(flown, plan, times) < 0.01
    assert np.abs(flown[:, 3] - plan.evaluate(times)[:, 3]).max() < 0.02
    assert held.largest_m == pytest.approx(farthest_m(flown, plan, times), abs=2e-4)


def test_joins_are_smooth_to_the_acceleration_and_the_ends_are_the_plans():
    plan = walk(40)
    found = poly4d.refit(plan, most_pieces=8).trajectory
    for derivative, slack in enumerate((1e-9, 1e-8, 1e-7)):
        assert np.abs(found.join_jumps(derivative)).max() < slack
    ends = [0.0, plan.duration_s]
    for derivative in range(3):
        np.testing.assert_allclose(found.evaluate(ends, derivative), plan.evaluate(ends, derivative), atol=1e-7)


def test_more_pieces_are_never_farther_away():
    plan = walk(40, laps=6.0)
    away = [poly4d.refit(plan, most_pieces=most).largest_m for most in (24, 27, 31)]
    assert away[0] > away[1] > away[2]


def test_what_fits_is_written_as_it_is():
    plan = walk(20)
    eighth = Trajectory(plan.durations_s, plan.coefficients[:, :, :6])
    found = poly4d.refit(eighth)
    assert found.largest_m == 0.0
    assert (found.trajectory.coefficients[:, :, :6] == eighth.coefficients).all()


def test_a_plan_that_is_too_long_is_refused_with_the_length_that_fits():
    plan = walk(200, laps=20.0)
    with pytest.raises(InputError, match=r"its first [\d.]+ s, [\d.]+ m, do") as refused:
        poly4d.refit(plan)
    fits_s = float(str(refused.value).split("its first ")[1].split()[0])
    first, _ = plan.split(fits_s - 0.1)
    assert poly4d.refit(first).largest_m < 0.01


def with_a_dash_between_stays(stay_s: float) -> Trajectory:
    """A walk of 34 pieces, a stay, .4 m out and back in a second, and a stay."""

    def curve(t: FloatArray) -> FloatArray:
        t = np.asarray(t)
        dash = np.clip(t - 8.5 - stay_s, 0.0, 1.0)
        out = 0.4 * np.sin(np.pi * dash) ** 4
        walked = np.clip(t, 0.0, 8.5)
        return np.stack([out + np.sin(walked / 8.5 * np.pi) ** 4, 0.0 * t, 1.0 + 0.0 * t, 0.0 * t], axis=-1)

    return fitted(curve, np.array([0.25] * 34 + [stay_s] + [0.125] * 8 + [stay_s]))


@pytest.mark.parametrize("stay_s", [20.0, 30.0, 60.0])
def test_a_leg_between_long_stays_is_not_lost(tmp_path, stay_s):
    plan = with_a_dash_between_stays(stay_s)
    held = formats.write_crazyflie(tmp_path / "w.csv", plan)
    times = np.union1d(plan.sample(0.002), plan.starts_s)
    flown = as_the_firmware(rows_of(tmp_path / "w.csv"), times)
    assert farthest_m(flown, plan, times) < 0.01
    assert held.largest_m == pytest.approx(farthest_m(flown, plan, times), abs=2e-4)


def test_what_single_precision_loses_far_from_the_origin_is_refused(tmp_path):
    far = Trajectory(np.full(2, 1.0), np.zeros((2, 4, 8)))
    far.coefficients[:, 0, 0] = 450_000.11
    with pytest.raises(InputError, match=r"single precision.* cm and .*450000 m from the origin"):
        formats.write_crazyflie(tmp_path / "w.csv", far)


def test_the_yaw_is_held_too(tmp_path):
    """A heading that swings while the place rests needs pieces of its own, and its error has a figure."""

    def curve(t: FloatArray) -> FloatArray:
        t = np.asarray(t)
        return np.stack([0.0 * t, 0.0 * t, 1.0 + 0.0 * t, np.sin(2.0 * t)], axis=-1)

    plan = fitted(curve, np.full(80, 0.25))
    held = formats.write_crazyflie(tmp_path / "w.csv", plan)
    times = plan.sample(0.01)
    turned = np.abs(as_the_firmware(rows_of(tmp_path / "w.csv"), times)[:, 3] - plan.evaluate(times)[:, 3]).max()
    assert turned < poly4d.WITHIN_RAD
    assert held.largest_rad == pytest.approx(turned, abs=1e-3)
    with pytest.raises(InputError, match=r"0\.03 rad from the plan"):
        poly4d.require_near(poly4d.Refit(held.trajectory, 0.0, 0.03, 0.0))


def test_no_piece_at_a_finer_tolerance_does_not_refuse_what_fits(monkeypatch):
    plan, pieces = walk(40), poly4d._pieces

    def only_coarse(plan: Trajectory, within_m: float, most: int) -> Trajectory:
        if within_m < poly4d.WITHIN_M:
            raise InputError("no smooth piece")
        return pieces(plan, within_m, most)

    monkeypatch.setattr(poly4d, "_pieces", only_coarse)
    assert poly4d.refit(plan).largest_m < poly4d.WITHIN_M


@pytest.mark.slow
@pytest.mark.skipif(FIRMWARE not in os.environ, reason=f"{FIRMWARE} names no sources of crazyflie-firmware")
def test_the_firmwares_own_evaluator_flies_the_plan(tmp_path):
    plan = walk(200)
    formats.write_crazyflie(tmp_path / "w.csv", plan)
    modules = Path(os.environ[FIRMWARE]) / "src" / "modules"
    (tmp_path / "harness.c").write_text(HARNESS)
    sources = [str(tmp_path / "harness.c"), str(modules / "src" / "pptraj.c")]
    include, program = f"-I{modules / 'interface'}", str(tmp_path / "harness")
    subprocess.run(["gcc", "-O1", include, *sources, "-lm", "-o", program], check=True)
    rows, times = rows_of(tmp_path / "w.csv"), plan.sample(0.01)
    numbers = [f"{len(rows)} {len(times)}", *map(repr, rows.ravel().tolist()), *map(repr, times.tolist())]
    said = subprocess.run([program], input="\n".join(numbers), capture_output=True, text=True, check=True).stdout
    flown = np.array([[float(word) for word in line.split()] for line in said.splitlines()])
    assert farthest_m(flown, plan, times) < 0.01
    np.testing.assert_allclose(flown, as_the_firmware(rows, times), atol=1e-4)
