"""What is left over, and what explains it: shares on stretches left out, bands, and every figure of a comparison."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

import sysid
import vehicle
from flight import FlightLog
from sysid.diagnosis.evidence import explained
from sysid.diagnosis.evidence.free_form import VARIABLE
from sysid.estimator.result import CHANNELS
from sysid.estimator.validation.comparison import Comparison, Residual
from sysid.report import diagnosis_figures, residual_plots, write_comparison
from tests.sysid import flying

DAMPING = 0.002


def damping(velocity: np.ndarray, rate: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return 0.0 * velocity, -DAMPING * rate * np.array([0.0, 0.0, 1.0])


def flights(extra) -> list[FlightLog]:
    rng = np.random.default_rng(3)
    truth = flying.Truth(extra=extra)
    return flying.fly(truth, flying.paper_flights(rng), 3, duration_s=10.0, rng=rng, rate_hz=100.0)[1:]


@pytest.fixture(scope="module")
def compared() -> Comparison:
    lacking = vehicle.example("rigter2019")
    knowing = lacking.with_effect("angular_damping", x_n_m_s=0.0, y_n_m_s=0.0, z_n_m_s=DAMPING)
    return sysid.compare(flights(damping), {"lacking": lacking, "knowing": knowing})


def test_the_share_explained_names_channel_and_variable_and_goes_once_the_effect_is_there(compared):
    channel, variable, share = residual_plots.most_telling(compared.residuals["lacking"])
    assert (channel, variable) == ("M_z", "w_z")
    assert share > 0.8
    names, after = explained.shares(compared.residuals["knowing"])
    assert after[CHANNELS.index("M_z"), names.index("w_z")] < 0.3 * share
    assert ((after >= 0.0) & (after <= 1.0)).all()


def share_of_v_x(flights: list[Residual], unseen: Sequence[Residual] = ()) -> float:
    names, found = explained.shares(flights, unseen)
    return float(found[CHANNELS.index("F_x"), names.index("v_x")])


def with_force(one: Residual, slope: float) -> Residual:
    """The same flight with nothing left but a force along x that follows the velocity."""
    wrench = np.zeros_like(one.wrench)
    wrench[:, 0] = slope * one.velocity_body_m_s[:, 0]
    return replace(one, wrench=wrench)


def test_a_short_piece_of_a_flight_is_not_the_one_shown_over_time(compared):
    first, second = compared.residuals["lacking"]
    loud = replace(second, wrench=100.0 * second.wrench)
    assert residual_plots.loudest([first, loud]) == 1
    brief = replace(loud, time_s=loud.time_s[:200], wrench=loud.wrench[:200])
    assert np.ptp(brief.time_s) < 0.5 * np.ptp(first.time_s)
    assert residual_plots.loudest([first, brief]) == 0


def test_a_share_counts_only_on_flights_that_the_curve_was_not_drawn_through(compared):
    """What follows a variable upwards in one flight and downwards in the other is no law, and explains nothing."""
    first, second = compared.residuals["lacking"]
    law = [with_force(first, 0.1), with_force(second, 0.1)]
    chance = [with_force(first, 0.1), with_force(second, -0.1)]
    assert share_of_v_x(law) > 0.95
    assert share_of_v_x(law[:1], law[1:]) > 0.95
    assert share_of_v_x(chance) == 0.0
    assert share_of_v_x(chance[:1], chance[1:]) == 0.0
    assert share_of_v_x(chance[:1]) > 0.95  # alone, its own stretches judge it


def test_flights_that_teach_do_not_judge(compared):
    """Noise on the flight that teaches blurs the curve a little, and counts against it nowhere else."""
    rng = np.random.default_rng(1)
    clean = with_force(compared.residuals["lacking"][0], 0.1)
    loud = float(np.sqrt((clean.wrench[:, 0] ** 2).mean())) * np.sqrt(10.0)
    noisy = replace(clean, wrench=clean.wrench + loud * rng.standard_normal((len(clean.wrench), 1)))
    assert share_of_v_x([noisy], [clean]) > 0.8
    assert share_of_v_x([noisy, clean]) < 0.75


def test_a_law_goes_on_beyond_the_range_that_was_flown(compared):
    """The flight that judges is three times as fast as the one that teaches."""
    slow = compared.residuals["lacking"][0]
    mid = replace(slow.mid, velocity_body_m_s=3.0 * slow.mid.velocity_body_m_s)
    fast = replace(slow, mid=mid, velocity_body_m_s=3.0 * slow.velocity_body_m_s)
    assert share_of_v_x([with_force(slow, 0.1)], [with_force(fast, 0.1)]) > 0.95


def test_a_trace_is_drawn_over_what_was_recorded_and_not_over_a_voltage_that_was_not(compared):
    flights = [with_force(r, 0.1) for r in compared.residuals["lacking"]]
    assert all(np.isnan(r.flight.battery_v).all() for r in flights)
    trace = np.concatenate([r.means()[:, 0] for r in flights])
    assert diagnosis_figures.follows(trace, flights) == "v_x"
    drift = diagnosis_figures.follows(np.linspace(-1.0, 1.0, len(trace)), flights)
    assert np.isfinite(explained.read(flights, VARIABLE[drift])).all()


def test_noise_is_explained_by_nothing(compared):
    rng = np.random.default_rng(0)
    noise = [replace(r, wrench=rng.standard_normal(r.wrench.shape)) for r in compared.residuals["lacking"]]
    assert explained.shares(noise)[1].max() < 0.1


def test_the_heat_map_says_what_judged_it(compared):
    first, second = compared.residuals["lacking"]
    said = [residual_plots.heat_map({"m": a}, {"m": b} if b else None).get_suptitle() for a, b in (
        ([first, second], ()), ([first], ()), ([first], [second]))]  # fmt: skip
    for words, sentence in zip(("on flights that", "on stretches that", second.flight.name), said, strict=True):
        assert words in sentence


def test_a_right_model_stays_within_its_band(compared):
    for residual in compared.residuals["knowing"]:
        outside = np.abs(residual.means()) > 1.96 * residual.sigma
        assert outside.mean() < 0.1
        assert (residual.sigma > 0.0).all()


def test_a_comparison_is_one_page_with_every_figure(compared, tmp_path):
    page = write_comparison(tmp_path / "c.html", compared).read_text()
    assert page.count("data:image/svg+xml") == 7
    assert "lacking" in page
    assert "src='http" not in page
