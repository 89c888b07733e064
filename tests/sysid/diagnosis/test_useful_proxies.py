"""A name that a curve outdoes is added where it lowers the held-out error, last of all, and is called a proxy."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from sysid.diagnosis import effect_sizes, examined, fitting, search
from sysid.diagnosis.evidence.candidates import Candidate
from sysid.diagnosis.evidence.confirm import CostReduction
from sysid.diagnosis.evidence.free_form import VARIABLE
from sysid.diagnosis.examined import Outside
from sysid.diagnosis.findings import JudgedBy, Outcome
from sysid.diagnosis.trial import Trial
from sysid.estimator.result import NOT_IDENTIFIABLE
from vehicle import effects

CURVE = cast("Any", SimpleNamespace(channel="F_z", variable="v_z"))


def candidate(name: str, *, between_flights: bool = False) -> Candidate:
    return Candidate(name, name, (f"{name}.x",), (False,), (1.0,), ("F_z",), "v", (), between_flights=between_flights)


def curve(channel: str, variable: str, gain: float) -> Outside:
    scored = cast("Any", SimpleNamespace(gain_unseen=gain, log_odds=gain / 2.0, dispersion=2.0))
    return Outside(channel, variable, scored, 1.0)


def outdone(name: str, *, confirmed: bool = True, **kind: bool) -> Trial:
    fell = CostReduction(np.array([3.0, 4.0, 5.0]))
    return Trial(
        candidate(name, **kind),
        Outcome.PROXY,
        fell,
        fell,
        JudgedBy.HELD_OUT,
        "",
        confirmed,
        0.9,
        (),
        CURVE,
        cast("Any", name),
    )


@pytest.fixture
def helpful(monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Candidates that the judging flights confirm beside whatever is in the model; grown by the test."""
    names: set[str] = set()
    fell = CostReduction(np.array([8.0, 9.0, 10.0]))

    def fitted(logs: Any, model: Any, one: Candidate, options: Any) -> Any:
        vehicle = SimpleNamespace(value=lambda name: 0.04 if name == "c.x" else 0.06)
        fit = SimpleNamespace(holds=(*model.holds, one.name), vehicle=vehicle)
        return SimpleNamespace(candidate=one, fit=fit, reduction=fell)

    def examined(fit: Any) -> Any:
        return SimpleNamespace(holds=fit.holds, scores={n: None for n in "abcd" if n not in fit.holds})

    monkeypatch.setattr(search, "fitted_once", fitted)
    monkeypatch.setattr(search, "examine", examined)
    monkeypatch.setattr(search, "_confirmed", lambda model, one, unseen: (fell, one.candidate.name in names, ""))
    return names


def added(trials: list[Trial]) -> list[tuple[Trial, Any]]:
    model = cast("Any", SimpleNamespace(holds=(), scores=dict.fromkeys("abcd")))
    return search._useful_proxies((), model, trials, "", cast("Any", None))


def test_every_proxy_that_still_helps_is_added_to_the_one_before(helpful):
    helpful |= {"a", "b"}
    found = added([outdone("a"), outdone("b"), outdone("c")])
    assert [trial.candidate.name for trial, _ in found] == ["a", "b"]
    assert [model.holds for _, model in found] == [("a",), ("a", "b")]
    for trial, _ in found:
        assert trial.outcome is Outcome.USEFUL_PROXY
        assert trial.held_out.total == 27.0
        assert trial.sentence.startswith("added as a useful proxy: the cost of held-out flights fell by 27.0 ± 1.7")
        assert "a free curve of F_z against v_z shows that another law is missing" in trial.sentence


def test_a_name_that_went_as_too_small_beside_a_curve_may_come_back_as_a_proxy_and_what_explained_most_is_first(
    helpful,
):
    helpful |= {"a", "b"}
    more = CostReduction(np.array([30.0, 40.0, 50.0]))
    small = replace(outdone("b"), outcome=Outcome.REMOVED, training=more)
    assert [trial.candidate.name for trial, _ in added([outdone("a"), small])] == ["b", "a"]
    unnecessary = replace(small, proxy_for=None)  # by a later addition
    assert added([unnecessary]) == []


def test_what_held_out_flights_did_not_prefer_is_no_useful_proxy(helpful):
    helpful |= {"a", "b"}
    assert added([outdone("a", confirmed=False)]) == []
    assert added([outdone("d")]) == []


def test_a_proxy_of_no_consequence_is_not_added_whatever_held_out_flights_prefer(helpful):
    helpful |= {"a", "c"}
    assert [trial.candidate.name for trial, _ in added([outdone("c"), outdone("a")])] == ["a"]


@pytest.mark.parametrize(("size", "half90", "goes"), [(0.07, 0.02, True), (-0.07, 0.02, True), (0.2, 0.2, False)])
def test_beside_a_stated_curve_a_name_too_small_to_matter_goes(size: float, half90: float, goes: bool):
    """Usual size 1; without a curve an effect is named however small."""
    estimate = SimpleNamespace(value=size, interval90=half90, status="free")
    model = cast("Any", SimpleNamespace(fit=SimpleNamespace(estimate=lambda name: estimate)))
    one = candidate("a", between_flights=True)
    for curve in (CURVE, None):
        assert search._small_beside(curve, model, [one]) == (one if goes and curve else None)
    removed = replace(outdone("a"), outcome=Outcome.REMOVED)
    assert "a free curve of F_z against v_z is needed" in removed.sentence
    assert "a later addition" in replace(removed, proxy_for=None).sentence


@pytest.mark.parametrize(("channel", "confidence"), [("T", 0.5), ("F_z", 0.97)])
def test_a_curve_that_changed_when_a_small_name_went_is_stated_with_even_odds_at_most(channel: str, confidence: float):
    drawn = replace(curve(channel, "v_z", 60.0), confidence=0.97)
    removed = replace(outdone("a"), outcome=Outcome.REMOVED)  # for a curve of F_z against v_z
    assert search._as_sure(drawn, [outdone("b"), removed]).confidence == confidence
    assert search._as_sure(drawn, [replace(removed, proxy_for=None)]).confidence == 0.97


@pytest.mark.parametrize(
    ("channel", "gain", "own"),
    [("F_z", 19.0, True), ("T", 19.0, True), ("F_z", 21.0, False), ("M_z", 19.0, False), ("F_z", np.nan, False)],
)
def test_a_small_curve_in_the_channel_of_a_named_effect_is_of_its_form(channel: str, gain: float, own: bool):
    """Small: it explains less than a fifth of what the effect does."""
    small, large = candidate("a"), candidate("b")
    assert examined.form_of(curve(channel, "v_z", gain), [(small, 50.0), (large, 100.0)]) == (large if own else None)
    assert examined.form_of(curve(channel, "v_z", gain), []) is None


@pytest.mark.parametrize(
    ("channel", "variable", "own"),
    [
        ("F_z", "speed", True),
        ("F_z", "v_x v_z", True),
        ("T", "s", True),
        ("F_z", "w_x", False),
        ("F_z", "n_2", False),
        ("F_z", "dn_2/dt", False),
        ("F_z", "height", False),
        ("F_z", "heading", False),
        ("F_z", "time", False),
        ("F_x_world", "x", False),
    ],
)
def test_the_form_of_a_law_follows_what_the_law_reads(channel: str, variable: str, own: bool):
    """What else is followed in its channel is another law, unless what it reads does about as well."""
    drag, drawn = candidate("a"), curve(channel, variable, 15.0)
    assert examined.form_of(drawn, [(drag, 100.0)]) == (drag if own else None)
    worse, as_good = curve(channel, "v_z", 8.0), curve(channel, "v_z", 10.0)
    if channel == "F_z":
        assert examined.form_of(drawn, [(drag, 100.0)], [drawn, worse]) == (drag if own else None)
        assert examined.form_of(drawn, [(drag, 100.0)], [drawn, as_good]) == drag


@pytest.mark.parametrize(
    ("channel", "variable", "gain", "own"),
    [
        ("F_y", "v_y", 95.0, True),
        ("F_x", "v_x", 60.0, True),
        ("F_y", "v_x", 60.0, False),
        ("F_z", "v_z", 60.0, False),
        ("F_y", "v_y", 110.0, False),
    ],
)
def test_a_level_force_by_its_own_speed_beside_a_named_drag_is_that_drag(channel, variable, gain, own):
    """Whatever its share, short of explaining more than the name did; up and down inflow is as likely."""
    drag = replace(candidate("parasitic_drag_linear"), channels=("F_x", "F_y", "F_z"))
    wind = replace(drag, name="constant_wind", effect="constant_wind")
    assert examined.form_of(curve(channel, variable, gain), [(drag, 100.0)]) == (drag if own else None)
    assert examined.form_of(curve(channel, variable, gain), [(wind, 100.0)]) is None


@pytest.mark.parametrize("explained", [50.0, 150.0, 400.0])
def test_a_drag_has_its_form_whatever_else_that_reads_speed_is_named_and_explains_more(explained: float):
    drag = replace(candidate("parasitic_drag_linear"), channels=("F_x", "F_y", "F_z"))
    wind = replace(drag, name="constant_wind", effect="constant_wind")
    named = [(drag, 100.0), (wind, explained)]
    assert examined.form_of(curve("F_y", "v_y", 60.0), named) == drag
    assert examined.form_of(curve("F_z", "v_z", 60.0), named) == (wind if explained == 400.0 else None)


def test_every_effect_of_the_catalogue_that_shows_in_a_channel_reads_something(drawable):
    for name in drawable:
        one = replace(candidate("a"), regressor=effects.find(name).regressor)
        assert any(examined.reads(one, curve("F_z", variable, 1.0)) for variable in VARIABLE), name
    wind = replace(candidate("a"), regressor=effects.find("constant_wind").regressor)
    assert examined.reads(wind, curve("F_x_world", "height", 1.0))


@pytest.fixture
def drawable() -> list[str]:
    """Effects whose form a curve can be of; gaps to the ceiling are in no curve."""
    shown = [name for name, e in effects.catalogue().items() if "F_" in e.channel or "M_" in e.channel]
    return [name for name in shown if name != "ceiling_effect"]


def test_a_curve_that_is_of_no_named_law_is_stated_beside_one_that_is(monkeypatch: pytest.MonkeyPatch):
    """The form of a drag's law may explain more than a second law in another channel, or of another variable."""
    monkeypatch.setattr(examined, "_beyond_chance", lambda found: True)
    drag = candidate("a")
    form, torque, weak = curve("F_z", "v_z", 150.0), curve("M_z", "v_z", 100.0), curve("M_z", "w_z", 80.0)
    for drawn, second in (((form, torque, weak), torque), ((form,), None)):
        model = cast("Any", SimpleNamespace(tried=examined.Tried(drawn=[*drawn], curve=[form]), all_heard=True))
        forms, stated = examined.forms_and_curve(model, [(drag, 1000.0)])
        assert forms == [(drag, form)]
        assert (stated and (stated.channel, stated.variable)) == (second and ("M_z", "v_z"))
        assert examined.forms_and_curve(model, []) == ([], form)


def test_only_what_is_left_of_a_named_effects_form_speaks_for_nothing_unknown():
    """Gains are twice the log odds here: a curve that explains a fifth of what the name does is another law."""
    drawn = [curve("F_z", "v_z", 80.0), curve("T", "v_z", 60.0), curve("M_z", "w_z", 8.0)]
    model = cast("Any", SimpleNamespace(tried=SimpleNamespace(curve=[None], drawn=drawn)))
    one = candidate("a")
    assert examined.left_unexplained(model, []) == 40.0
    assert examined.left_unexplained(model, [(one, 1000.0)]) == 4.0
    assert examined.left_unexplained(model, [(one, 350.0)]) == 40.0
    drawn.append(curve("M_z", "w_x", np.nan))
    assert np.isnan(examined.left_unexplained(model, [(one, 1000.0)]))


@pytest.mark.parametrize(("again", "goes"), [((), "a"), (("a",), "b"), (("a", "b"), None)])
def test_an_addition_goes_only_where_nothing_would_bring_it_back(monkeypatch: pytest.MonkeyPatch, again, goes):
    """Of three, the last test leaves two in doubt, the first most."""
    chance = {"a": 0.02, "b": 0.01, "c": 1e-6}
    monkeypatch.setattr(fitting, "loss", lambda model, one: SimpleNamespace(significance=chance[one.name]))
    monkeypatch.setattr(fitting, "refit_without", lambda logs, model, one, options: f"without {one.name}")
    monkeypatch.setattr(fitting, "significant", lambda model: [candidate(name) for name in again])
    found = fitting.superfluous((), cast("Any", None), [candidate(name) for name in "abc"], cast("Any", None))
    assert (found and (found[0].name, found[1])) == (goes and (goes, f"without {goes}"))


@pytest.mark.parametrize(("half90", "status"), [(np.nan, "free"), (0.0, NOT_IDENTIFIABLE)])
def test_a_size_that_is_not_known_is_not_called_too_small(half90: float, status: str):
    estimate = SimpleNamespace(value=0.01, interval90=half90, status=status)
    assert effect_sizes.may_matter(cast("Any", SimpleNamespace(estimate=lambda name: estimate)), candidate("a"))


def test_a_load_between_flights_is_no_proxy_and_nothing_is_added_twice(helpful):
    helpful |= {"a", "b"}
    assert added([outdone("a", between_flights=True)]) == []
    assert len(added([outdone("a"), outdone("a")])) == 1


def test_what_fell_too_little_is_said_so():
    fell = outdone("a")
    for total, words in ((12.0, "fell, but not surely enough"), (-12.0, "did not help")):
        judged = CostReduction(np.full(3, total / 3.0))
        refused = Trial(
            fell.candidate, Outcome.NOT_CONFIRMED, judged, judged, JudgedBy.HELD_OUT, "", False, 0.1, (), None, fell.fit
        )
        assert refused.sentence.startswith(words)
        assert replace(refused, vanishes=True).sentence.startswith(
            "not added: its fitted size is not significantly different from zero; the cost"
        )


@pytest.mark.parametrize(("size", "expected"), [(0.04, False), (-0.06, True)])
def test_a_size_below_a_twentieth_of_the_usual_one_is_of_no_consequence(size: float, expected):
    fit: Any = SimpleNamespace(vehicle=SimpleNamespace(value={"a.x": size}.__getitem__))
    assert effect_sizes.matters(fit, candidate("a")) is expected
    history = search._History([cast("Any", SimpleNamespace(fit=fit))], added=[candidate("a")])
    assert bool(history.mattering) is expected


@pytest.mark.parametrize(
    ("half90", "status", "expected"), [(0.03, "free", True), (0.05, "free", False), (0.0, NOT_IDENTIFIABLE, False)]
)
def test_a_size_shows_whose_interval_is_apart_from_zero(half90: float, status: str, expected: bool):
    estimate = SimpleNamespace(value=-0.04, interval90=half90, status=status)
    assert effect_sizes.shows(cast("Any", SimpleNamespace(estimate=lambda name: estimate)), candidate("a")) is expected


@pytest.mark.parametrize(
    ("moments", "stated", "confidence"),
    [
        ((300.0, 290.0), "M_x", 0.97),
        ((300.0, 202.0), "M_x", 0.709),
        ((300.0, 200.0), "T", 0.485),
        ((300.0, 198.0), "T", 0.709),
        ((300.0, 0.0), "T", 0.97),
    ],
)
def test_a_curve_of_thrust_and_curves_of_its_channels_share_one_probability(moments, stated, confidence):
    gains = {"T": 500.0, "M_x": moments[0], "M_y": moments[1], "M_z": 100.0}
    model = cast("Any", SimpleNamespace(all_heard=True))
    best = examined._best_of(model, [curve(channel, "v_x", gain) for channel, gain in gains.items()])
    assert best is not None
    assert best.channel == stated
    assert best.confidence == pytest.approx(confidence, abs=0.01)


@pytest.mark.parametrize(
    ("lift", "force", "stated", "confidence"),
    [(500.0, 500.0, "F_z", 0.97), (505.0, 500.0, "F_z", 0.97), (507.0, 500.0, "L", 0.91), (500.0, None, "L", 0.97)],
)
def test_a_curve_of_lift_that_shows_in_no_moment_is_one_of_the_force(lift, force, stated, confidence):
    drawn = [curve("L", "speed", lift), *([curve("F_z", "speed", force)] if force else []), curve("F_z", "v_x", 100.0)]
    best = examined._best_of(cast("Any", SimpleNamespace(all_heard=True)), drawn)
    assert best is not None
    assert best.channel == stated
    assert best.confidence == pytest.approx(confidence, abs=0.01)
