"""What is left over, and what explains it: shares on stretches left out, bands, and every figure of a comparison."""

import numpy as np
import pytest

import sysid
import vehicle
from flight import FlightLog
from sysid import explained, report, residual_plots
from sysid.comparison import Comparison
from sysid.result import CHANNELS
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


def test_a_right_model_stays_within_its_band(compared):
    for residual in compared.residuals["knowing"]:
        outside = np.abs(residual.means()) > 1.96 * residual.sigma
        assert outside.mean() < 0.1
        assert (residual.sigma > 0.0).all()


def test_a_comparison_is_one_page_with_every_figure(compared, tmp_path):
    drawn = sysid.plots.comparison(compared, tmp_path / "p")
    names = {path.stem for path in drawn}
    assert names >= {"residual_wrench", "residual_share", "residual_against", "residual_path"}
    page = report.write_comparison(tmp_path / "c.html", compared).read_text()
    assert page.count("data:image/svg+xml") == len(drawn)
    assert "lacking" in page
    assert "src='http" not in page
