"""What no known effect is has a physics all the same: that of the law that explains most of it and reads the same."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from sysid.diagnosis.evidence.candidates import Candidate
from sysid.diagnosis.examined import Outside, of_its_physics
from vehicle import effects

NAMES = ("translational_lift", "airframe_side_moment", "rotor_interaction", "ground_effect", "parasitic_drag_linear")


def candidate(name: str) -> Candidate:
    effect = effects.find(name)
    channels = tuple(c for c in effect.channel.split() if c[:2] in ("F_", "M_"))
    return Candidate(name, name, (), (), (), channels, effect.regressor, ())


def asked(channel: str, variable: str, **gains: float) -> list[tuple[str, float]]:
    scores = {name: SimpleNamespace(gain_unseen=gains.get(name, 0.0)) for name in NAMES}
    model = SimpleNamespace(candidate_set=SimpleNamespace(candidates=[candidate(n) for n in NAMES]), scores=scores)
    curve = Outside(channel, variable, cast("Any", SimpleNamespace(gain_unseen=100.0, dispersion=2.0)), 0.9)
    return [(one.name, share) for one, share in of_its_physics(curve, cast("Any", model))]


def test_the_one_that_explains_most_comes_first_and_shares_sum_to_one():
    found = asked("F_z", "speed", translational_lift=30.0, parasitic_drag_linear=28.0)
    assert [name for name, _ in found[:2]] == ["translational_lift", "parasitic_drag_linear"]
    assert sum(share for _, share in found) == pytest.approx(1.0)
    assert found[0][1] / found[1][1] == pytest.approx(2.718281828)  # the fall of the cost over its dispersion


def test_a_curve_of_thrust_is_of_a_law_of_thrust_though_a_moment_explains_more():
    assert asked("T", "s", rotor_interaction=10.0, airframe_side_moment=50.0)[0][0] == "rotor_interaction"


def test_what_reads_something_else_or_explains_nothing_is_not_its_physics():
    assert asked("F_z", "speed", ground_effect=90.0) == []
    assert asked("M_z", "voltage", airframe_side_moment=90.0) == []
