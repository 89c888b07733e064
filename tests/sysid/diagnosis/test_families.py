"""The family of what is missing is surer than any of its forms; a form that the catalogue lacks lowers theirs."""

from dataclasses import replace

import pytest

from sysid.diagnosis.families import families, family, family_of, of_curve
from sysid.diagnosis.thresholds import THRESHOLDS
from vehicle import effects

DRAG = {"parasitic_drag_linear": 0.79, "parasitic_drag": 0.15, "rotor_drag_thrust": 0.02}


def test_a_family_is_as_likely_as_all_its_forms_together():
    found = family(DRAG, 0.0, most=0.97)
    assert found.name == "drag"
    assert found.probability == pytest.approx(0.96)
    assert [form.name for form in found.forms] == list(DRAG)
    assert sum(form.probability for form in found.forms) + found.another_form == pytest.approx(found.probability)
    assert found.sentence.startswith("drag 96%: parasitic_drag_linear (linear in airspeed) 79%, parasitic_drag (")
    assert not found.is_another_form


@pytest.mark.parametrize("another", [0.0, 0.02, 0.4, 0.6, 1.0])
def test_a_form_that_the_catalogue_lacks_lowers_the_forms_and_not_the_family(another: float):
    found = family(DRAG, another, most=0.97)
    assert found.probability == pytest.approx(0.96)
    assert found.another_form == pytest.approx(0.96 * another)
    assert found.is_another_form == (another > 0.5)
    assert ("another form" in found.sentence) == (another > 0.011)
    assert found.known_form == pytest.approx(1.0 if another > 0.5 else 1.0 - another)


def test_no_family_is_believed_more_than_anything_may_be():
    found = family({"angular_damping": 0.9, "angular_damping_quadratic": 0.4}, 0.0, most=THRESHOLDS.even_confidence)
    assert found.probability == THRESHOLDS.even_confidence
    assert sum(form.probability for form in found.forms) == pytest.approx(THRESHOLDS.even_confidence)


def test_rivals_of_another_family_are_no_forms_of_this_one():
    rivals = (("parasitic_drag", 0.2), ("constant_wind", 0.1))
    (found,) = families([("rotor_drag_thrust", 0.6, rivals)], {"rotor_drag_thrust": 0.0}, most=1.0)
    assert [form.name for form in found.forms] == ["rotor_drag_thrust", "parasitic_drag"]
    assert found.probability == pytest.approx(0.8)


def test_every_form_of_a_family_has_words_and_every_lone_effect_is_its_own_family():
    by_family: dict[str, list[str]] = {}
    for name, effect in effects.catalogue().items():
        assert bool(effect.family) == bool(effect.form), name
        assert family_of(name) == (effect.family or name)
        by_family.setdefault(family_of(name), []).append(effect.form)
    for forms in by_family.values():
        assert len(forms) == len(set(forms))
    expected = {"drag", "thrust curve", "torque curve", "inflow", "flapping", "moments", "motor", "damping"}
    assert expected <= set(by_family)
    assert family_of("weak_rotor[2]") == family_of("thrust_affine")


def test_a_family_with_one_form_says_no_more_than_its_name():
    assert not family({"payload": 0.9}, 0.0, most=1.0).has_forms
    assert replace(family({"payload": 0.9}, 0.0, most=1.0), another_form=0.0).sentence == "payload 90%: payload 90%"


def test_two_forms_that_are_named_together_are_one_family_and_may_be_one_law_that_the_catalogue_lacks():
    """As rotor drag and quadratic drag that stand in for a linear one."""
    named = [("rotor_drag_thrust", 0.97, ()), ("parasitic_drag_speed", 0.96, ()), ("angular_damping", 0.9, ())]
    drag, damping = families(named, {"rotor_drag_thrust": 0.9}, most=1.0)
    assert (drag.name, damping.name) == ("drag", "damping")
    assert drag.names == ("rotor_drag_thrust", "parasitic_drag_speed")
    assert drag.is_another_form
    assert not damping.is_another_form
    assert drag.lacking == (
        "drag in a form that the catalogue lacks (the nearest is rotor_drag_thrust and parasitic_drag_speed)"
    )
    exact, _ = families(named, {"rotor_drag_thrust": 0.0}, most=1.0)
    assert not exact.is_another_form
    assert exact.known_form == pytest.approx(1.0, abs=1e-3)


def test_a_curve_is_of_the_family_that_explains_most_of_it_in_a_form_that_none_has():
    found = of_curve([("translational_lift", 0.6), ("weak_rotor[1]", 0.3), ("thrust_bem", 0.1)], 0.8)
    assert found is not None
    assert found.name == "inflow"
    assert found.probability == pytest.approx(0.8 * 0.7)
    assert found.is_another_form
    assert found.lacking == "inflow in a form that the catalogue lacks (the nearest is translational_lift)"
    assert "translational_lift" not in found.sentence


def test_a_curve_of_no_known_physics_has_no_family():
    assert of_curve([], 0.9) is None
