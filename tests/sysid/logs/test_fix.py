"""Fixes: what a planted fault changed comes back, and only what the checks proposed is touched."""

import numpy as np
import pytest

from flight import FlightLog, frames
from sysid.estimator.options import Options
from sysid.estimator.prepare import prepare
from sysid.logs.check import check_log
from sysid.logs.fix import FIXES, fix

ROTORS = [f"rotor_speed_{i}_rad_s" for i in range(4)]
RATES = [f"rate_body_{axis}_rad_s" for axis in "xyz"]
POSITION = [f"position_world_{axis}_m" for axis in "xyz"]
QUATERNION = [f"q_world_body_{i}" for i in "wxyz"]


def changed(log: FlightLog, **columns: np.ndarray) -> FlightLog:
    return FlightLog({**log.columns, **columns}, log.metadata)


def in_rpm(log):
    return changed(log, **{name: log.columns[name] * 30.0 / np.pi for name in ROTORS})


def in_deg(log):
    return changed(log, **{name: np.rad2deg(log.columns[name]) for name in RATES})


def xyzw(log):
    return changed(log, **{q: log.columns[QUATERNION[(i + 1) % 4]] for i, q in enumerate(QUATERNION)})


def conjugated(log):
    return changed(log, **{name: -log.columns[name] for name in QUATERNION[1:]})


def z_down(log):
    position = dict(zip(POSITION, frames.flip_vector(log.vector("position_world_m")).T, strict=True))
    rate = dict(zip(RATES, frames.flip_vector(log.vector("rate_body_rad_s")).T, strict=True))
    q = dict(zip(QUATERNION, frames.flip_attitude(log.vector("q_world_body")).T, strict=True))
    return changed(log, **position, **rate, **q)


def shuffled(log):
    return changed(log, **{name: log.columns[ROTORS[k]] for name, k in zip(ROTORS, (2, 0, 3, 1), strict=True)})


def turned(log):
    return changed(log, rate_body_y_rad_s=-log.columns["rate_body_y_rad_s"])


def milliseconds(log):
    return changed(log, time_s=1000.0 * log.time_s)


def everything(log):
    return milliseconds(in_rpm(in_deg(z_down(shuffled(log)))))


@pytest.mark.parametrize(
    "fault",
    [in_rpm, in_deg, xyzw, conjugated, z_down, shuffled, turned, milliseconds, everything],
    ids=lambda f: f.__name__,
)
def test_a_planted_fault_is_mended_to_the_log_as_it_was(log, truth, fault):
    mended = fix(fault(log), truth)
    assert mended.done
    assert mended.left == ()
    for name in ("time_s", *ROTORS, *RATES, *POSITION):
        np.testing.assert_allclose(mended.log.columns[name], log.columns[name], rtol=1e-9, atol=1e-9, err_msg=name)
    same = np.abs((mended.log.vector("q_world_body") * log.vector("q_world_body")).sum(axis=1))
    np.testing.assert_allclose(same, 1.0, atol=1e-9)
    assert mended.log.metadata[FIXES] == list(mended.done)


@pytest.mark.parametrize(("names", "rows"), [(ROTORS, 4), (ROTORS, -3), (RATES, 3)])
def test_a_shifted_clock_is_brought_back_to_two_milliseconds(log, truth, names, rows):
    late = changed(log, **{name: np.roll(log.columns[name], rows) for name in names})
    late = late.slice(0.1, 9.8)  # what np.roll carried round the end
    mended = fix(late, truth)
    assert {f.what for f in mended.left} <= {"clock"}
    shift_ms = [float(s.rsplit("by", 1)[1].split()[0]) for s in mended.done if "time stamps" in s]
    assert sum(shift_ms) == pytest.approx(-10.0 * rows, abs=2.0)
    assert all(np.isfinite(values).all() for values in mended.log.columns.values())


def test_jumps_are_cut_out_and_nothing_else(log, truth):
    z = log.columns["position_world_z_m"].copy()
    z[500] += 0.4
    mended = fix(changed(log, position_world_z_m=z), truth)
    lost = np.isnan(mended.log.columns["position_world_z_m"])
    assert lost[500]
    assert lost.sum() <= 3
    np.testing.assert_array_equal(mended.log.columns["position_world_z_m"][~lost], z[~lost])
    assert mended.left == ()
    assert prepare(mended.log, 0, Options()), "a fit takes the corrected log"


def test_a_clean_log_stays_as_it_is(log, truth):
    mended = fix(log, truth)
    assert mended.done == ()
    assert mended.log is log


def test_what_no_change_of_the_log_mends_is_left(log, truth):
    keep = (log.time_s < 4.0) | (log.time_s > 4.6)
    mended = fix(FlightLog({k: v[keep] for k, v in log.columns.items()}, {}), truth)
    assert {f.what for f in mended.left} == {"gap"}
    assert FIXES not in mended.log.metadata


def test_every_finding_with_a_place_lies_within_the_log(log, truth):
    z = log.columns["position_world_z_m"].copy()
    z[500] += 0.4
    for finding in check_log(changed(log, position_world_z_m=z), truth).findings:
        for first_s, last_s in finding.spans:
            assert log.time_s[0] <= first_s <= last_s <= log.time_s[-1]


def test_progress_is_told_after_every_fix(log, truth):
    told: list[float] = []
    mended = fix(everything(log), truth, progress=lambda _, fraction: told.append(fraction))
    assert len(told) == len(mended.done) + 1
    assert told[0] == 0.0
    assert all(0.0 < fraction <= 1.0 for fraction in told[1:])
