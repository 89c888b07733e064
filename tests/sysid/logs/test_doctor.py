"""Recordings in which something happened, from the file to what a fit takes: found, mended where that is certain."""

import numpy as np
import pytest

import vehicle
from flight import FlightLog, InputError, rotations
from flight.flight_log import COLUMNS
from sysid.estimator.options import Options
from sysid.estimator.prepare import prepare
from sysid.logs.check import check_log, is_gone
from sysid.logs.fix import FIXES, REPAIRS, fix
from sysid.logs.reading import read_log
from tests.sysid.logs.px4_file import stamps_us, ulog

AT = 480


@pytest.fixture
def recorded(tmp_path, log):
    """Reads the flight as PX4 wrote it, with what went wrong."""

    def read(**wrong) -> FlightLog:
        path = tmp_path / "flight.ulg"
        path.write_bytes(ulog(log, **wrong))
        return read_log(path)

    return read


def of_events(log: FlightLog, believed: vehicle.Vehicle | None = None) -> list:
    return [f for f in check_log(log, believed).findings if f.event is not None]


def heading_reset(log: FlightLog, deg: float) -> FlightLog:
    q = log.vector("q_world_body").copy()
    q[AT:] = rotations.multiply(rotations.exp(np.array([0.0, 0.0, np.deg2rad(deg)])), q[AT:])
    return FlightLog({**log.columns, **dict(zip(COLUMNS["q_world_body"], q.T, strict=True))}, log.metadata)


def test_one_zero_stamp_of_the_attitude_is_left_out_and_said(recorded, log):
    stamps = stamps_us(log)
    stamps[AT] = 0
    clean, read = recorded(), recorded(stamps={"vehicle_attitude": stamps})
    assert len(read) == len(clean)
    apart = rotations.angle_between(read.vector("q_world_body"), clean.vector("q_world_body"))
    assert float(apart.max()) < 0.01
    assert [(f.level, f.what) for f in of_events(read)] == [("warning", "zero stamp")]
    assert of_events(clean) == []


def test_an_esc_clock_that_goes_back_is_shifted_and_no_spin_is_turned(recorded, log, truth):
    stamps = stamps_us(log)
    stamps[AT:] -= 3_000_000
    clean, read = recorded(), recorded(stamps={"esc_status": stamps})
    np.testing.assert_allclose(
        read.vector("rotor_speed_rad_s"), clean.vector("rotor_speed_rad_s"), rtol=1e-6, equal_nan=True
    )
    (finding,) = of_events(read)
    assert finding.event.size == pytest.approx(3.0, abs=0.02)
    assert not any("spin" in f.what for f in check_log(read, truth).findings)


def test_a_heading_reset_splits_the_log_and_gives_both_pieces_one_heading(log, truth):
    reset = heading_reset(log, 30.0)
    for given in (reset, reset.slice(2.0, np.inf)):  # the piece after the reset is the shorter one, then the longer
        mended = fix(given, truth)
        assert mended.log.metadata["splits_s"] == [[log.time_s[AT - 1], log.time_s[AT]]]
        q, was = mended.log.vector("q_world_body"), log.slice(given.time_s[0], np.inf).vector("q_world_body")
        turns = rotations.multiply(q, rotations.conjugate(was))
        assert float(rotations.angle_between(turns, turns[:1]).max()) < np.deg2rad(1.0)
        assert not any(f.what == "attitude jump" for f in mended.left)
        assert len(mended.log.metadata[FIXES]) == len(mended.log.metadata[REPAIRS])


def test_a_fit_refuses_a_leap_or_splits_there_and_takes_a_mended_log_as_it_is(log, truth):
    reset = heading_reset(log, 30.0)
    with pytest.raises(InputError, match=r"attitude jumps by .* deg about the vertical at 4.80"):
        prepare(reset, 0, Options())
    pieces = prepare(reset, 0, Options(gaps="split"))
    assert len(pieces) == 2
    assert pieces[0].time_s[-1] < log.time_s[AT] <= pieces[1].time_s[0]
    assert len(prepare(fix(reset, truth).log, 0, Options())) == 2


def test_a_kind_that_is_left_is_left(log, truth):
    reset = heading_reset(log, 30.0)
    assert "splits_s" not in fix(reset, truth, leave=["attitude jump", "frame"]).log.metadata


def test_an_attitude_on_another_clock_is_refused_in_one_sentence(recorded, log):
    with pytest.raises(InputError, match=r"Its clock has another zero, 59\.000 s earlier"):
        recorded(stamps={"vehicle_attitude": stamps_us(log) - 59_000_000})


def test_the_estimators_own_counter_names_the_reset(recorded, log):
    counter = (np.arange(len(log)) >= AT).astype(float)
    (finding,) = of_events(recorded(resets=counter))
    assert finding.what == "reset"
    assert finding.spans[0][1] == pytest.approx(log.time_s[AT], abs=0.02)


def test_a_change_counts_only_if_its_finding_is_then_gone(log, truth):
    late = {name: np.roll(log.columns[name], 4) for name in COLUMNS["rotor_speed_rad_s"]}
    report = check_log(FlightLog({**log.columns, **late}, {}), truth)
    (finding,) = (f for f in report.findings if f.what == "clock")
    assert not is_gone(finding, report)
    assert is_gone(finding, check_log(log, truth))
