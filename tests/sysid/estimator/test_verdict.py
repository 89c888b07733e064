"""One verdict on every fit: physics and the vehicle file against what came out."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import vehicle
from flight.units import RAD_S_PER_RPM
from sysid.estimator.blocks.noise import Noise
from sysid.estimator.result import unpredicted_turning
from sysid.estimator.trajectory.states import States
from sysid.estimator.verdict import WRONG_KINDS, Use, Verdict, of_fit, of_logs, too_large_inertias
from sysid.logs.check import LogReport
from sysid.logs.checks.finding import Finding
from vehicle import Vehicle

FREE = ("thrust_bem.k1_n_s2", "inertia_xx_kg_m2", "inertia_yy_kg_m2", "inertia_zz_kg_m2")


class Flown:
    """As much of a flight as the verdict looks at."""

    def __init__(self, speed_rad_s: float = 950.0) -> None:
        self.rotor_speed_rad_s = np.full((10, 4), speed_rad_s)
        self.full_throttle_rad_s = None


def scaled(believed: Vehicle, by: float, *names: str) -> Vehicle:
    for name in names:
        believed = believed.with_value(name, by * believed.value(name))
    return believed


def verdict(given: Vehicle, fitted: Vehicle, free: tuple[str, ...] = FREE) -> Verdict:
    return of_fit(given, fitted, [Flown()], free, ())  # type: ignore[list-item]


@pytest.fixture
def truth() -> Vehicle:
    """With thrust that is proportional to k1."""
    return vehicle.example().with_value("thrust_bem.k2_n_s2_m", 0.0)


@pytest.mark.parametrize("name", ["rigter2019", "hummingbird"])
def test_vehicles_as_they_are_are_usable(name):
    believed = vehicle.example(name)
    thrust = next(p for p in believed.parameters if p.startswith("thrust_"))
    assert of_fit(believed, believed, [Flown(500.0)], (thrust, *FREE[1:]), ()).use is Use.USABLE  # type: ignore[list-item]


@pytest.mark.parametrize(
    ("factor", "use", "words"),
    [
        (1.1, Use.USABLE, ""),
        (3.0, Use.DOUBTFUL, "weigh the vehicle"),
        (0.3, Use.DOUBTFUL, "weigh the vehicle"),
        (30.0, Use.REJECTED, "check the unit"),
        (RAD_S_PER_RPM**-2, Use.REJECTED, "rad/s was read as rpm"),
        (88.0, Use.REJECTED, "rad/s was read as rpm"),
        (RAD_S_PER_RPM**2, Use.REJECTED, "rpm was read as rad/s"),
    ],
)
def test_thrust_far_from_the_file_names_its_likely_cause(truth, factor, use, words):
    found = verdict(truth, scaled(truth, factor, "thrust_bem.k1_n_s2"))
    assert found.use is use
    assert words in found.sentence


def test_an_absurd_thrust_is_found_though_the_file_has_it_too(truth):
    absurd = scaled(truth, RAD_S_PER_RPM**-2, "thrust_bem.k1_n_s2")
    found = verdict(absurd, absurd)
    assert found.use is Use.REJECTED
    assert "thrust coefficient" in found.sentence


@pytest.mark.parametrize(("factor", "use"), [(1.2, Use.USABLE), (12.0, Use.DOUBTFUL), (20.0, Use.REJECTED)])
def test_inertia_is_judged_by_mass_and_arm(truth, factor, use):
    heavy = scaled(truth, factor, *FREE[1:])
    assert verdict(heavy, heavy).use is use


@pytest.mark.parametrize(("factor", "use"), [(1.2, Use.USABLE), (2.9, Use.DOUBTFUL), (5.0, Use.REJECTED)])
def test_an_inertia_that_neither_mass_and_arm_nor_the_file_allows_is_refused(truth, factor, use):
    """Roll inertia of mass times arm squared is 3.6 times this vehicle's."""
    found = verdict(truth, scaled(truth, factor, *FREE[1:3]))
    assert found.use is use
    if use is Use.REJECTED:
        assert "inertia_xx_kg_m2 came out 0.0153" in found.sentence
        assert "(0.011 kg m2)" in found.sentence  # the bound
        assert "gusts='estimate'" in found.sentence  # the way out


def test_inertias_are_not_judged_by_hubs_that_are_all_at_the_origin(truth):
    nowhere = replace(truth, hub_body_m=np.zeros((4, 3)))
    assert too_large_inertias(nowhere, scaled(nowhere, 4.0, *FREE[1:]), FREE) == ()
    assert too_large_inertias(truth, scaled(truth, 4.0, FREE[1]), FREE) == (FREE[1],)


def test_no_body_turns_harder_about_one_axis_than_about_the_other_two_together(truth):
    found = verdict(truth, scaled(truth, 2.2, "inertia_zz_kg_m2"))
    assert found.use is Use.DOUBTFUL
    assert "inertia_zz_kg_m2" in found.sentence


def test_what_was_held_is_not_judged(truth):
    absurd = scaled(truth, 100.0, *FREE[1:], "thrust_bem.k1_n_s2")
    assert verdict(truth, absurd, free=("parasitic_drag.drag_xy_kg_m",)).use is Use.USABLE


def test_the_worse_of_two_verdicts_counts_and_no_reason_is_lost():
    good, doubtful, bad = Verdict(), Verdict(doubts=("a",)), Verdict(against=("b",))
    assert good.beside(doubtful).use is Use.DOUBTFUL
    both = doubtful.beside(bad)
    assert both.use is Use.REJECTED
    assert (both.as_dict()["use"], both.as_dict()["reasons"]) == ("do not use", ["b", "a"])
    assert both.beside(replace(both)).as_dict() == both.as_dict()
    assert good.sentence == "usable"


def turning(amplitude_rad_s2: float) -> tuple[SimpleNamespace, SimpleNamespace]:
    """States that turn about all axes at one rad/s, and the flight they belong to."""
    time_s = np.arange(0.0, 20.0, 0.01)
    rate = np.sqrt(2.0) * amplitude_rad_s2 * np.sin(time_s)[:, None] * np.ones(3)
    nothing = np.zeros((len(time_s), 3))
    states = States(nothing, nothing, np.tile([1.0, 0.0, 0.0, 0.0], (len(time_s), 1)), rate)
    return SimpleNamespace(states=(states,)), SimpleNamespace(time_s=time_s)


@pytest.mark.parametrize(("left_rad_s2", "doubted"), [(0.03, False), (0.9, False), (1.1, True), (4.0, True)])
def test_a_model_that_leaves_more_turning_than_there_was_is_doubted(left_rad_s2, doubted):
    point, flight = turning(1.0)
    noise = Noise({"motion": np.sqrt(0.1) * np.array([0.1, 0.1, 0.1, left_rad_s2, 0.01, 0.01])})
    solution = SimpleNamespace(noise=noise, point=point)
    said = unpredicted_turning(solution, [flight], FREE)  # type: ignore[arg-type]
    assert len(said) == doubted
    assert all("about x" in sentence for sentence in said)
    assert unpredicted_turning(solution, [flight], ("inertia_yy_kg_m2",)) == ()  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("level", "what", "use"),
    [
        *(("error", what, Use.REJECTED) for what in WRONG_KINDS),
        ("warning", "frame", Use.USABLE),
        ("error", "gap", Use.USABLE),
    ],
)
def test_a_log_in_wrong_units_or_frames_forbids_what_is_fitted_to_it(level, what, use):
    finding = Finding(what=what, level=level, sentence="it is z down", fix="turn it")
    assert of_logs([LogReport("a.csv", 1.0, 10.0, (finding,))]).use is use
