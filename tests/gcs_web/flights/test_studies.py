"""Spectra, pairs and tables of a flight's streams."""

import csv
from collections.abc import Iterable

import numpy as np
import pytest

from flight import FlightLog, FloatArray, InputError, flight_log, project
from gcs_web.flights import studies
from gcs_web.flights.recorded import Recorded
from gcs_web.flights.studies import Samples


def of(time_s: FloatArray, values: FloatArray, key: str = "speed") -> Samples:
    return Samples(key, "measured", "measured", "m/s", time_s, values)


@pytest.mark.parametrize("count", [64, 999, 5000])
def test_a_spectrum_holds_the_variance_and_its_peak_is_where_the_tone_is(count):
    time_s = np.arange(count) / 250.0
    tone = 0.7 * np.sin(2 * np.pi * 31.0 * time_s) + 5.0
    found = studies.density(of(time_s, tone))
    frequency_hz, density = found.frequency_hz, found.density
    assert abs(frequency_hz[np.argmax(density)] - 31.0) <= frequency_hz[1]
    assert np.sum(density) * frequency_hz[1] == pytest.approx(0.7**2 / 2, rel=0.05)
    assert len(frequency_hz) <= studies.MOST_BANDS + 1


def test_white_noise_is_as_strong_at_every_frequency():
    rng = np.random.default_rng(0)
    noise = rng.normal(0.0, 2.0, 200_000)
    density = studies.density(of(np.arange(len(noise)) / 100.0, noise)).density
    np.testing.assert_allclose(density[2:-2], 2.0**2 / 50.0, rtol=0.5)  # over 0 to 50 Hz


def test_a_spectrum_is_the_same_with_a_pause_in_the_log_and_reaches_over_none():
    time_s = np.arange(4000) / 200.0
    values = np.sin(2 * np.pi * 20.0 * time_s)
    late = np.where(time_s > 11.0, time_s + 3.0, time_s)
    elsewhere = values + np.where(time_s > 11.0, 50.0, 0.0)  # which a piece over the pause would see as a step
    for found in (studies.density(of(time_s, values)), studies.density(of(late, elsewhere))):
        frequency_hz, density = found.frequency_hz, found.density
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
    assert rows_of(studies.table([[fast, slow]], 100.0)) == [
        ["log_time_s", "plot_time_s", "speed measured [m/s]", "F_x measured [m/s]"],
        ["100", "0", "1", ""],
        ["100.1", "0.1", "", "7.5"],
        ["100.2", "0.2", "3", ""],
    ]


def rows_of(pieces: Iterable[bytes]) -> list[list[str]]:
    return list(csv.reader(b"".join(pieces).decode().splitlines()))


def test_a_table_in_pieces_is_the_table_in_one():
    whole = of(np.arange(10) / 10.0, np.arange(10.0))
    other = of(np.arange(0.0, 2.0, 0.25), np.arange(8.0), "F_x")
    parts = [[of(whole.time_s[i : i + 3], whole.values[i : i + 3])] for i in range(0, 10, 3)]
    assert rows_of(studies.table(studies.beside(parts, [other]), 0.0)) == rows_of(studies.table([[whole, other]], 0.0))


@pytest.mark.parametrize("count", [600, 1000, 4000])
def test_noise_does_not_look_like_peaks(count):
    noise = np.random.default_rng(1).normal(size=count)
    density = studies.density(of(np.arange(count) / 250.0, noise)).density
    assert density[2:-2].std() < 0.5 * density[2:-2].mean()


def test_a_spectrum_is_the_mean_of_all_stretches_and_says_what_it_leaves_out():
    spans = [np.arange(count) / 250.0 for count in (4096, 3800, 100)]
    begins = np.cumsum([0.0, *(span[-1] + 1.0 for span in spans[:-1])])
    time_s = np.concatenate([span + begin for span, begin in zip(spans, begins, strict=True)])
    loud = np.where((time_s >= begins[1]) & (time_s < begins[2]), 1.0, 0.0)
    found = studies.density(of(time_s, loud * np.sin(2 * np.pi * 40.0 * time_s)))
    assert np.sum(found.density) * found.frequency_hz[1] == pytest.approx(0.5 * 3800 / (4096 + 3800), rel=0.08)
    assert 0.9 < found.share <= (4096 + 3800) / len(time_s)


@pytest.fixture
def mixed(tmp_path) -> tuple[Recorded, FloatArray]:
    """A battery at 50 Hz in a log at 500 Hz, in two pieces on disk."""
    opened = project.create(tmp_path / "hall", "hall")
    opened.flight("a").parent.mkdir(exist_ok=True)
    count = flight_log.PIECE_ROWS + 5000
    values = np.full(count, np.nan)
    values[::10] = 1.7e9 + np.random.default_rng(0).normal(size=len(values[::10]))
    times = {"time_s": 30.0 + np.arange(count) / 500.0}
    places = {f"position_world_{axis}_m": np.zeros(count) for axis in "xyz"}
    flight_log.save(opened.flight("a"), FlightLog({**times, **places, "battery_v": values}, {}))
    return Recorded(opened), values[::10]


def test_only_what_was_measured_is_studied_and_saved_and_no_digit_of_it_is_lost(mixed):
    recorded, measured = mixed
    (samples,) = recorded.samples("a", ["battery"], -1.0, 1e9)
    np.testing.assert_array_equal(samples.values[np.isfinite(samples.values)], measured)
    found = studies.density(samples)
    assert found.frequency_hz[-1] == pytest.approx(25.0)
    for part in np.array_split(found.density[2:-2], 4):
        assert part.mean() == pytest.approx(1.0 / 25.0, rel=0.15)
    head, *rows = rows_of(studies.table(recorded.stretches("a", ["battery"], -1.0, 1e9), 30.0))
    assert head == ["log_time_s", "plot_time_s", "battery measured [V]"]
    np.testing.assert_array_equal([float(row[2]) for row in rows], measured)
    assert [float(row[0]) for row in rows[:2]] == [30.0, 30.02]


@pytest.mark.parametrize("stretch", [(5.0, 1.0), (1.0, 1.0), (float("nan"), 3.0), (0.0, float("nan"))])
def test_a_stretch_without_length_is_refused(mixed, stretch):
    recorded, _ = mixed
    for ask in (recorded.samples, recorded.stretches):
        with pytest.raises(InputError, match="has no length"):
            ask("a", ["battery"], *stretch)


def test_a_spectrogram_shows_when_a_tone_sounds_and_reaches_over_no_pause():
    time_s = np.arange(6000) / 200.0
    values = np.where(time_s < 15.0, np.sin(2 * np.pi * 20.0 * time_s), np.sin(2 * np.pi * 60.0 * time_s))
    for when in (time_s, np.where(time_s > 28.0, time_s + 9.0, time_s)):
        found = studies.spectrogram(of(when, values))
        assert len(found.time_s) <= studies.MOST_COLUMNS
        assert found.power_db.shape == (len(found.frequency_hz), len(found.time_s))
        loudest_hz = found.frequency_hz[np.argmax(found.power_db, axis=0)]
        step_hz = found.frequency_hz[1]
        early, late = found.time_s < 14.0, (found.time_s > 16.0) & (found.time_s < 28.0)
        assert np.all(np.abs(loudest_hz[early] - 20.0) <= step_hz)
        assert np.all(np.abs(loudest_hz[late] - 60.0) <= step_hz)
        assert np.ptp(found.power_db) <= studies.SPECTROGRAM_DB + 1e-6
    with pytest.raises(InputError, match="a spectrum needs 64"):
        studies.spectrogram(of(time_s[:50], values[:50]))


def test_a_spectrogram_of_a_million_samples_has_few_columns_and_leaves_out_none():
    time_s = np.arange(1_000_000) / 1000.0
    values = np.zeros(len(time_s))
    values[700_100:700_300] = np.sin(2 * np.pi * 100.0 * time_s[:200])
    found = studies.spectrogram(of(time_s, values))
    assert studies.MOST_COLUMNS / 2 < len(found.time_s) <= studies.MOST_COLUMNS
    row, column = np.unravel_index(np.argmax(found.power_db), found.power_db.shape)
    assert found.frequency_hz[row] == pytest.approx(100.0, abs=5.0)
    assert found.time_s[column] == pytest.approx(700.2, abs=5.0)


def test_parquet_is_given_away_as_it_is_written_with_the_times_of_the_csv():
    asked = []

    def stretches():
        for i in range(3):
            asked.append(i)
            yield [of(np.arange(100) / 3.0 + 100.0 * i, np.arange(100.0))]

    import pyarrow.parquet as pq

    pieces = studies.parquet(stretches(), 0.1)
    first = next(pieces)
    assert asked == [0]
    table = pq.read_table(pa_file(first + b"".join(pieces)))
    times_s = table["log_time_s"].to_numpy()
    np.testing.assert_array_equal(times_s, np.round(times_s, 9))


def test_parquet_has_the_numbers_of_the_csv():
    import pyarrow.parquet as pq

    a, b = of(np.arange(100) / 100.0, np.arange(100.0)), of(np.arange(50) / 50.0, np.full(50, 2.5), "tilt")
    b = Samples(b.key, b.label, b.kind, "°", b.time_s, np.where(np.arange(50) == 7, np.nan, b.values))
    stretches = [
        [a, b],
        [of(a.time_s + 1.0, a.values), b.__class__("tilt", "measured", "measured", "°", b.time_s + 1.0, b.values)],
    ]
    rows = list(csv.reader(b"".join(studies.table(stretches, 3.0)).decode().splitlines()))
    table = pq.read_table(pa_file(b"".join(studies.parquet(stretches, 3.0))))
    assert table.column_names == rows[0]
    assert len(table) == len(rows) - 1 == 200
    for column, name in enumerate(table.column_names):
        expected = [float(row[column]) if row[column] else None for row in rows[1:]]
        found = table[name].to_pylist()
        assert [value is None for value in found] == [value is None for value in expected]
        np.testing.assert_allclose(
            [v for v in found if v is not None], [v for v in expected if v is not None], atol=1e-9
        )


def pa_file(content: bytes):
    import pyarrow as pa

    return pa.BufferReader(content)
