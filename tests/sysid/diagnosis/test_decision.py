"""The verdict on a candidate: which of several reasons decides, and with how much confidence."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import vehicle
from sysid.diagnosis import told
from sysid.diagnosis.decision import Case, Reason, decide, sentence
from sysid.diagnosis.evidence.candidates import Candidate
from sysid.diagnosis.findings import CandidateFinding, Outcome, Size, Verdict
from sysid.diagnosis.procedure import Diagnosis
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.estimator import verdict as fits

CANDIDATE = Candidate("angular_damping", "angular_damping", (), (), (), ("M_x",), "w", ("rotation", "yaw"))
SMALL = Size("angular_damping.z_n_m_s", "N m s", 1e-5, 1e-5, half90=1.6e-5, smallest_visible=1e-4, usual=1e-3)
SOME = replace(SMALL, value=1e-4, sigma=4e-5, half90=6.6e-5)
"""Below what would matter, and not below a twentieth of the usual size."""
OPEN = replace(SMALL, sigma=3e-4, half90=4.9e-4, smallest_visible=2e-3)
CURVE = cast("Any", SimpleNamespace(channel="M_z", variable="w_z", confidence=0.8))


def trial(outcome: Outcome, between: tuple[str, ...] = ("angular_damping", "pose_delay")) -> Any:
    return SimpleNamespace(
        outcome=outcome, confidence=0.9, between=between, sentence="it was tried", probability=lambda name: 0.6
    )


def case(significance: float = 0.5, **found: Any) -> Case:
    alone = Case(
        candidate=CANDIDATE,
        score=cast("Any", SimpleNamespace(significance=significance)),
        sizes=(SMALL,),
        trial=None,
        added=False,
        curve=None,
        undecided=None,
        doubted=False,
        carried_by=(),
        no_load="",
        rejected=False,
    )
    return replace(alone, **found)


SIGNIFICANT = 0.5 * THRESHOLDS.chance
SIGN = 0.5 * THRESHOLDS.weak_sign


@pytest.mark.parametrize(
    ("given", "verdict", "reason"),
    [
        (case(), Verdict.EXCLUDED, Reason.TOO_SMALL),
        (case(rejected=True), Verdict.INCONCLUSIVE, Reason.REJECTED_FIT),
        (case(sizes=(SMALL, OPEN)), Verdict.INCONCLUSIVE, Reason.TOO_WEAK),
        (case(SIGN, sizes=(SMALL, SOME)), Verdict.INCONCLUSIVE, Reason.WEAK_SIGN),
        (
            case(SIGN, sizes=(SMALL, SOME), rejected=True),
            Verdict.INCONCLUSIVE,
            Reason.REJECTED_FIT,
        ),
        (case(SIGN, sizes=(SMALL, OPEN)), Verdict.INCONCLUSIVE, Reason.TOO_WEAK),
        (case(SIGN), Verdict.EXCLUDED, Reason.TOO_SMALL),
        (case(sizes=(replace(SMALL, sigma=0.0),)), Verdict.INCONCLUSIVE, Reason.TOO_WEAK),
        (case(SIGNIFICANT), Verdict.INCONCLUSIVE, Reason.ANOTHER_EXPLAINS_MORE),
        (case(SIGNIFICANT, curve=CURVE), Verdict.INCONCLUSIVE, Reason.CURVE_EXPLAINS_MORE),
        (case(curve=CURVE), Verdict.EXCLUDED, Reason.TOO_SMALL),
        (case(trial=trial(Outcome.USEFUL_PROXY), useful_proxy=True), Verdict.PROXY, Reason.USEFUL_PROXY),
        (case(SIGNIFICANT, trial=trial(Outcome.NOT_CONFIRMED)), Verdict.INCONCLUSIVE, Reason.TRIED),
        (case(trial=trial(Outcome.REMOVED)), Verdict.INCONCLUSIVE, Reason.TRIED),
        (case(no_load="weights differ", trial=trial(Outcome.NOT_CONFIRMED)), Verdict.INCONCLUSIVE, Reason.NO_LOAD),
        (case(trial=trial(Outcome.ADDED), added=True), Verdict.PRESENT, Reason.CONFIRMED),
        (case(SIGNIFICANT, trial=trial(Outcome.ADDED), negligible=True), Verdict.EXCLUDED, Reason.NEGLIGIBLE),
        (case(undecided=trial(Outcome.UNDECIDED)), Verdict.INCONCLUSIVE, Reason.ONE_OF_SEVERAL),
        (case(doubted=True, undecided=trial(Outcome.UNDECIDED)), Verdict.INCONCLUSIVE, Reason.FEW_STRETCHES),
    ],
)
def test_the_first_reason_that_holds_decides(given: Case, verdict: Verdict, reason: Reason):
    decision = decide(given)
    assert (decision.verdict, decision.reason) == (verdict, reason)


def test_nothing_that_is_excluded_has_any_confidence():
    assert decide(case()).confidence == 0.0
    assert decide(case(rejected=True)).confidence == 0.0


def test_of_what_shows_and_is_too_small_to_matter_it_is_said_what_is_excluded():
    given = case(SIGNIFICANT, trial=trial(Outcome.ADDED), negligible=True)
    assert decide(given).confidence == 0.0
    assert sentence(given, decide(given)).startswith("it shows, and is too small to matter: z_n_m_s above 2.6e-05")


def test_a_curve_takes_its_share_of_the_confidence_in_the_channels_that_it_is_of():
    assert decide(case(SIGNIFICANT)).confidence == THRESHOLDS.even_confidence
    assert decide(case(SIGNIFICANT, curve=CURVE)).confidence == THRESHOLDS.even_confidence
    about_z = replace(CANDIDATE, channels=("M_x", "M_z"))
    beside = case(SIGNIFICANT, curve=CURVE, candidate=about_z)
    assert decide(beside).confidence == pytest.approx(0.2 * THRESHOLDS.even_confidence)


def test_one_of_several_has_its_own_probability():
    given = case(undecided=trial(Outcome.UNDECIDED))
    assert decide(given).confidence == 0.6
    assert sentence(given, decide(given)).startswith("either it or pose_delay is missing")


def test_what_is_too_weak_to_tell_says_within_what_it_is_and_what_would_have_shown():
    given = case(sizes=(SMALL, OPEN))
    said = sentence(given, decide(given))
    for words in ("too weak to tell", "within -0.00048 and 0.0005 N m s", "shown from 0.002", "usually 0.001"):
        assert words in said
    assert "nothing was flown" in sentence(case(sizes=()), decide(case(sizes=(replace(SMALL, sigma=0.0),))))


def test_what_may_show_below_what_would_matter_is_not_called_too_weak_to_tell():
    """Its usual size would have shown, so no sentence says that these flights could not."""
    given = case(SIGN, sizes=(SMALL, SOME))
    said = sentence(given, decide(given))
    assert "a weak sign of it" in said
    assert "too small to matter: z_n_m_s above 2.6e-05 N m s, z_n_m_s above 0.00017 N m s" in said
    assert "usually" not in said


@pytest.mark.parametrize("value", [0.0, 1e-4, -1e-4, 2.5e-4])
@pytest.mark.parametrize("sigma", [1e-5, 1e-4, 3e-4])
def test_excluded_is_said_only_where_the_whole_interval_is_below_what_matters(value: float, sigma: float):
    size = replace(SMALL, value=value, sigma=sigma, half90=1.645 * sigma)
    below = max(abs(end) for end in size.interval90) <= THRESHOLDS.matters * size.usual
    assert (decide(case(sizes=(size,))).verdict is Verdict.EXCLUDED) == below


def test_a_name_beside_a_curve_is_stated_with_no_more_than_even_odds():
    """The law that the curve is of may act in other channels too, where a known effect fits a part of it."""
    confirmed = case(trial=trial(Outcome.ADDED), added=True)
    assert decide(confirmed).confidence == 0.9
    assert decide(replace(confirmed, curve=CURVE)).confidence == THRESHOLDS.beside_curve


REJECTED = fits.Verdict(against=("inertia_zz_kg_m2 came out 0.06, which no multirotor has",))
POSSIBLE = fits.Verdict(doubts=("thrust came out 2.2 times the vehicle file's",))


def test_neither_a_name_nor_a_curve_nor_an_attempt_is_surer_than_the_sentence_on_a_rejected_fit():
    confirmed = case(trial=trial(Outcome.ADDED), added=True, rejected=True)
    assert decide(confirmed).confidence == THRESHOLDS.even_confidence
    one_of_two = trial(Outcome.UNDECIDED)
    assert decide(case(undecided=one_of_two)).confidence == 0.6
    assert decide(case(undecided=one_of_two, rejected=True)).confidence == THRESHOLDS.even_confidence
    score = SimpleNamespace(covariance=np.eye(1), size=np.ones(1), gain_unseen=60.0, significance=1e-9)
    curve: Any = SimpleNamespace(channel="F_x", variable="constant", score=score, confidence=0.9)
    constant = SimpleNamespace(variable="constant", basis=lambda at: np.ones((len(at), 1)))
    model: Any = SimpleNamespace(
        evidence=SimpleNamespace(curves=[constant]),
        fit=SimpleNamespace(vehicle=vehicle.example()),
        candidate_set=SimpleNamespace(candidates=()),
    )
    assert told.of_curve(model, curve, unsure=False).confidence == 0.9
    assert told.of_curve(model, curve, unsure=True).confidence == THRESHOLDS.even_confidence
    fell = SimpleNamespace(total=60.0, sigma=5.0)
    tried: Any = SimpleNamespace(
        **vars(trial(Outcome.ADDED)), candidate=CANDIDATE, rivals=(), held_out=fell, judged_on="held-out flights"
    )
    assert told.of_attempt(tried, unsure=False).confidence == 0.9
    assert told.of_attempt(tried, unsure=True).confidence == THRESHOLDS.even_confidence


@pytest.mark.parametrize("says_missing", [True, False])
@pytest.mark.parametrize("of_logs", [fits.Verdict(), REJECTED])
@pytest.mark.parametrize("of_fit", [fits.Verdict(), POSSIBLE, REJECTED])
def test_no_sentence_has_more_than_even_odds_on_a_rejected_fit(of_logs, of_fit, says_missing: bool):
    """Whatever it says, and whether the fit itself or the check of the logs is against it."""
    name = SimpleNamespace(name="angular_damping", verdict=Verdict.PRESENT, confidence=0.96)
    whole: Any = SimpleNamespace(
        only_hovers=False,
        families=(),
        family_of_curve=None,
        input_verdict=of_logs,
        pose_may_be_late=False,
        says_missing=says_missing,
        unsaid=(),
    )
    whole.candidates, whole.undecided, whole.proxies, whole.outside = (name,) if says_missing else (), (), (), None
    last: Any = SimpleNamespace(fit=SimpleNamespace(verdict=of_fit))
    whole.search = SimpleNamespace(too_short="", left=0.0, left_anywhere=0.0, forms=(), doubted=(), models=(last,))
    whole.predicts = None
    whole.fit_verdict = Diagnosis.fit_verdict.fget(whole)  # type: ignore[attr-defined]
    usual = 0.96 if says_missing else THRESHOLDS.most_confidence
    most = THRESHOLDS.even_confidence if REJECTED in (of_logs, of_fit) else usual
    found = Diagnosis.belief.fget(whole)  # type: ignore[attr-defined]
    assert found.as_stated == pytest.approx(most)
    assert f"probability {most:.0%} that" in found.sentence(named=says_missing)


@pytest.mark.parametrize("says_missing", [False, True])
def test_flights_that_only_hover_leave_even_odds_and_the_sentence_says_what_to_fly(says_missing: bool):
    name = SimpleNamespace(name="weak_rotor[0]", verdict=Verdict.PRESENT, confidence=0.96)
    whole: Any = SimpleNamespace(
        only_hovers=True,
        candidates=(name,) if says_missing else (),
        additions=("weak_rotor[0]",) if says_missing else (),
        families=(),
        family_of_curve=None,
        undecided=(),
        outside=None,
        proxies=(),
        negligible=(),
        doubts=(),
        unsaid=(),
        pose_may_be_late=False,
        leaves_too_much=False,
        says_missing=says_missing,
        _said=str,
        input_verdict=fits.Verdict(),
        fit_verdict=fits.Verdict(),
        search=SimpleNamespace(too_short="", left=0.0, left_anywhere=0.0, forms=(), doubted=()),
    )
    verdict = Diagnosis.verdict.fget(whole)  # type: ignore[attr-defined]
    said = "missing was weak_rotor[0]" if says_missing else "nothing that these flights could show is missing"
    fly = "fast_level, vertical, doublets, yaw_doublets"
    assert verdict == f"{said}; they only hover, where little shows: fly {fly}"
    assert Diagnosis.belief.fget(whole).as_stated == THRESHOLDS.even_confidence  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("notes", "hovers"),
    [
        (("the mass was given", "all flights hover: no yaw; fly yaw_doublets"), True),
        (("the flight hovers: no yaw; fly yaw_doublets",), True),
        (("all flights are slow: no yaw; fly yaw_doublets",), False),
        ((), False),
    ],
)
def test_that_flights_only_hover_is_read_from_the_note_on_their_motion(notes: tuple[str, ...], hovers: bool):
    assert Diagnosis.only_hovers.fget(SimpleNamespace(findings=notes)) is hovers  # type: ignore[attr-defined]


def doubts(refuted: tuple[str, ...] = (), doubted: tuple[str, ...] = ("motor_lag",), **sizes: Size) -> tuple[str, ...]:
    """Of four candidates, two of them below one in 1,000 by chance; one of these is in the model."""
    weak, plain = 0.5 * THRESHOLDS.doubtful, 2.0 * THRESHOLDS.doubtful

    def found(name: str, significance: float, verdict: Verdict = Verdict.INCONCLUSIVE) -> CandidateFinding:
        own = (sizes.get(name, OPEN),)
        return CandidateFinding(name, verdict, "", own, 0.0, significance, 0.0, 0.5, (), (), (), "")

    candidates = [found("ground_effect", weak), found("constant_wind", plain), found("motor_lag", 0.5)]
    candidates += [found("payload", weak), found("weak_rotor[0]", weak, Verdict.PRESENT)]
    search = SimpleNamespace(doubted=doubted, refuted=frozenset(refuted))
    return Diagnosis.doubts.fget(cast("Any", SimpleNamespace(candidates=candidates, search=search)))  # type: ignore[attr-defined]


def test_a_candidate_that_hardly_shows_so_by_chance_may_be_missing():
    assert doubts() == ("ground_effect", "motor_lag", "payload")


def test_what_was_refuted_or_is_of_no_consequence_is_not_said_to_be_missing_perhaps():
    assert doubts(refuted=("ground_effect",)) == ("motor_lag", "payload")
    tiny = replace(SMALL, value=0.0, half90=0.9 * THRESHOLDS.least_size * SMALL.usual)
    assert doubts(motor_lag=tiny) == ("ground_effect", "payload")
    assert doubts(motor_lag=replace(OPEN, sigma=0.0)) == ("ground_effect", "payload")


def test_a_load_below_what_matters_is_not_said_to_be_missing_perhaps():
    """What a vehicle weighs shows in every hover."""
    small = replace(SMALL, value=0.0, half90=0.9 * THRESHOLDS.matters * SMALL.usual)
    assert doubts(payload=small) == ("ground_effect", "motor_lag")
    assert "ground_effect" in doubts(ground_effect=small)


@pytest.mark.parametrize(
    ("left", "doubted", "least", "most"),
    [(60.0, (), 0.9, 0.97), (3.0, (), 0.0, 0.01), (60.0, ("angular_damping",), 0.5, 0.5)],
)
def test_a_proxy_alone_says_that_something_unknown_is_missing(left: float, doubted, least: float, most: float):
    """With even odds at most where a known effect is as good as what is unknown."""
    whole: Any = SimpleNamespace(
        only_hovers=False,
        families=(),
        family_of_curve=None,
        additions=(),
        undecided=(),
        outside=None,
        proxies=("parasitic_drag",),
        candidates=(),
    )
    whole.search = SimpleNamespace(too_short="", left=0.0, left_anywhere=left, forms=(), doubted=doubted)
    whole.input_verdict = whole.fit_verdict = fits.Verdict()
    whole.pose_may_be_late, whole.unsaid = False, ()
    whole.says_missing = Diagnosis.says_missing.fget(whole)  # type: ignore[attr-defined]
    assert whole.says_missing
    assert least <= Diagnosis.belief.fget(whole).as_stated <= most  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("forms", "doubted", "words", "least", "most"),
    [
        (True, (), "a proxy for what the catalogue's law of angular_damping leaves, and is added", 0.89, 0.9),
        (False, (), "a proxy for something that no known effect is, and is added", 0.84, 0.89),
        (False, ("parasitic_drag",), "a proxy for parasitic_drag or something that no known effect is", 0.45, 0.5),
    ],
)
def test_a_proxy_beside_a_name_is_for_its_form_or_for_something_unknown(forms: bool, doubted, words: str, least, most):
    """What is said of the proxy has the probability that is stated: curves in the channels of the name count too."""
    name: Any = SimpleNamespace(name="angular_damping", verdict=Verdict.PRESENT, confidence=0.9)
    whole: Any = SimpleNamespace(
        only_hovers=False,
        families=(),
        family_of_curve=None,
        additions=("angular_damping",),
        undecided=(),
        outside=None,
        proxies=("flapping_moment",),
        candidates=(name,),
    )
    whole.leaves_too_much = whole.pose_may_be_late = False
    whole.says_missing, whole._said, whole.negligible = True, str, ()
    whole.doubts, whole.unsaid = ("ground_effect", "payload"), (SimpleNamespace(name="payload", confidence=0.0),)
    own = ((CANDIDATE, CURVE),) if forms else ()
    whole.search = SimpleNamespace(too_short="", left=0.0, left_anywhere=60.0, forms=own, doubted=doubted)
    whole.input_verdict = whole.fit_verdict = fits.Verdict()
    assert words in Diagnosis.verdict.fget(whole)  # type: ignore[attr-defined]
    assert "; payload may be missing too, which is not confirmed" in Diagnosis.verdict.fget(whole)  # type: ignore[attr-defined]
    assert least <= Diagnosis.belief.fget(whole).as_stated <= most  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("doubts", "words"),
    [
        ((), "nothing that matters is missing; centre_of_mass shows, too small to matter"),
        (("payload",), "payload may be: these flights are inconclusive; centre_of_mass shows, too small to matter"),
    ],
)
def test_what_shows_and_is_too_small_to_matter_is_said_and_not_called_missing(doubts: tuple[str, ...], words: str):
    whole: Any = SimpleNamespace(
        only_hovers=False,
        families=(),
        family_of_curve=None,
        additions=(),
        undecided=(),
        outside=None,
        proxies=(),
        negligible=("centre_of_mass",),
    )
    whole.leaves_too_much = whole.pose_may_be_late = whole.says_missing = False
    whole.doubts, whole.unsaid = doubts, tuple(SimpleNamespace(name=name) for name in doubts)
    whole.search, whole.input_verdict = SimpleNamespace(too_short=""), fits.Verdict()
    assert Diagnosis.verdict.fget(whole).endswith(words)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("additions", "outside", "unsaid"),
    [
        ((), None, ("rotor_interaction", "parasitic_drag", "flapping_moment")),
        (("parasitic_drag",), None, ("rotor_interaction", "flapping_moment")),
        (("flapping_moment",), None, ("parasitic_drag",)),
        ((), "F_x_world", ("rotor_interaction", "flapping_moment")),
        ((), "T", ()),
    ],
)
def test_the_sentence_is_only_as_likely_as_that_nothing_is_missing_where_nothing_stated_shows(
    additions: tuple[str, ...], outside: str | None, unsaid: tuple[str, ...]
):
    """What is left where a stated effect shows may be of the form of its law."""
    channels = {"rotor_interaction": ("M_x", "M_y"), "parasitic_drag": ("F_x", "F_z"), "flapping_moment": ("M_x",)}
    found = [
        SimpleNamespace(
            name=name,
            channels=shown,
            verdict=Verdict.PRESENT if name in additions else Verdict.INCONCLUSIVE,
            confidence=0.4,
            reaches=lambda share: True,
        )
        for name, shown in channels.items()
    ]
    drawn = outside and SimpleNamespace(channel=outside, confidence=1.0)
    whole: Any = SimpleNamespace(
        only_hovers=False,
        families=(),
        family_of_curve=None,
        candidates=found,
        additions=additions,
        undecided=(),
        proxies=(),
        outside=drawn,
    )
    whole.pose_may_be_late = False
    whole.search = SimpleNamespace(too_short="", left=0.0, left_anywhere=0.0, forms=(), doubted=())
    whole.input_verdict = whole.fit_verdict = fits.Verdict()
    whole.doubts, whole.says_missing = tuple(channels), bool(additions or outside)
    whole.unsaid = Diagnosis.unsaid.fget(whole)  # type: ignore[attr-defined]
    assert tuple(s.name for s in whole.unsaid) == unsaid
    if not whole.says_missing:
        found[0].reaches = lambda share: share < THRESHOLDS.least_size
        assert "rotor_interaction" not in {s.name for s in Diagnosis.unsaid.fget(whole)}  # type: ignore[attr-defined]
    if whole.says_missing:
        assert Diagnosis.unsaid.fget(SimpleNamespace(**{**vars(whole), "doubts": ()})) == ()  # type: ignore[attr-defined]
    named = 0.4 if additions else 1.0
    expected = min(THRESHOLDS.most_confidence, named * (0.6 if unsaid else 1.0))
    assert Diagnosis.belief.fget(whole).as_stated == pytest.approx(expected)  # type: ignore[attr-defined]
