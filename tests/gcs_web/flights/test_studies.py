"""Spectra, pairs and tables of a flight's streams."""

import csv

import numpy as np
import pytest

from flight import FloatArray, InputError
from gcs_web.flights import studies
from gcs_web.flights.studies import Samples


def of(time_s: FloatArray, values: FloatArray, key: str = "speed") -> Samples:
    return Samples(key, "measured", "measured", "m/s", time_s, values)


@pytest.mark.parametrize("count", [64, 999, 5000])
def test_a_spectrum_holds_the_variance_and_its_peak_is_where_the_tone_is(count):
    time_s = np.arange(count) / 250.0
    tone = 0.7 * np.sin(2 * np.pi * 31.0 * time_s) + 5.0
    frequency_hz, density = studies.density(of(time_s, tone))
    assert abs(frequency_hz[np.argmax(density)] - 31.0) <= frequency_hz[1]
    assert np.sum(density) * frequency_hz[1] == pytest.approx(0.7**2 / 2, rel=0.05)
    assert len(frequency_hz) <= studies.MOST_BANDS + 1


def test_white_noise_is_as_strong_at_every_frequency():
    rng = np.random.default_rng(0)
    noise = rng.normal(0.0, 2.0, 200_000)
    _, density = studies.density(of(np.arange(len(noise)) / 100.0, noise))
    np.testing.assert_allclose(density[2:-2], 2.0**2 / 50.0, rtol=0.5)  # over 0 to 50 Hz


def test_a_spectrum_is_the_same_with_a_pause_in_the_log_and_reaches_over_none():
    time_s = np.arange(4000) / 200.0
    values = np.sin(2 * np.pi * 20.0 * time_s)
    late = np.where(time_s > 11.0, time_s + 3.0, time_s)
    elsewhere = values + np.where(time_s > 11.0, 50.0, 0.0)  # which a piece over the pause would see as a step
    for frequency_hz, density in (studies.density(of(time_s, values)), studies.density(of(late, elsewhere))):
        assert abs(frequency_hz[np.argmax(density)] - 20.0) <= frequency_hz[1]
        assert density[frequency_hz > 40.0].max() < 1e-4 * density.max()


@pytest.mark.parametrize("values", [np.zeros(63), np.where(np.arange(200) % 4 == 0, 1.0, np.nan)])
def test_too_little_for_a_spectrum_is_said_with_the_way_out(values):
    with pytest.raises(InputError, match="a spectrum needs 64"):
        studies.density(of(np.arange(len(values)) / 100.0, values))


def test_pairs_stand_at_the_same_instants_and_cross_no_pause():
    x = of(np.arange(1000) / 100.0, np.arange(1000) / 100.0)
    slow_s = np.arange(0.0, 10.0, 0.1)
    slow_s = slow_s[(slow_s < 4.0) | (slow_s > 6.0)]
    time_s, a, b = studies.pairs(x, of(slow_s, 3.0 * slow_s))
    np.testing.assert_allclose(a, time_s)
    np.testing.assert_allclose(b, 3.0 * time_s)
    assert not ((time_s > 4.0) & (time_s < 6.0)).any()
    with pytest.raises(InputError, match="never measured together"):
        studies.pairs(x, of(slow_s + 100.0, slow_s))


def test_a_table_has_every_sample_of_every_curve_and_empty_cells_between():
    fast, slow = (
        of(np.array([0.0, 0.1, 0.2]), np.array([1.0, np.nan, 3.0])),
        of(np.array([0.1]), np.array([7.5]), "F_x"),
    )
    rows = list(csv.reader(studies.table([fast, slow])))
    assert rows == [
        ["time_s", "speed measured [m/s]", "F_x measured [m/s]"],
        ["0.000000", "1", ""],
        ["0.100000", "", "7.5"],
        ["0.200000", "3", ""],
    ]
