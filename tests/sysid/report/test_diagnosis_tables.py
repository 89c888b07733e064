"""Numbers in a report: value and error to the same digit, powers of ten where they help, units as people write them."""

import pytest

from sysid.diagnosis.evidence.free_form import EVERY_CHANNEL, UNIT, VARIABLES
from sysid.diagnosis.findings import CandidateFinding, Size, Verdict
from sysid.report import words
from sysid.report.diagnosis_tables import candidates, chance, measured, plain, unit
from vehicle import effects


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (0.000867, 0.000065, "(8.67 ± 0.65)·10<sup>−4</sup>"),
        (-0.000286, 0.000099, "(−2.86 ± 0.99)·10<sup>−4</sup>"),
        (0.0, 0.0014, "0.0000 ± 0.0014"),
        (0.7, 0.02, "0.700 ± 0.020"),
        (123.0, 4.0, "123.0 ± 4.0"),
        (0.25, 0.0, "0.25"),
    ],
)
def test_a_value_ends_at_the_second_digit_of_its_error(value, sigma, text):
    assert measured(value, sigma) == text


def test_plain_numbers_have_two_digits():
    assert [plain(x) for x in (0.0, 0.019, -0.019, 3.2e-5, 12.0, 8.9e6)] == [
        "0",
        "0.019",
        "−0.019",
        "3.2·10<sup>−5</sup>",
        "12",
        "8.9·10<sup>6</sup>",
    ]


def test_a_chance_that_no_number_holds_is_said_as_a_bound():
    assert chance(0.0) == "below 1·10<sup>−12</sup>"
    assert chance(0.03) == "0.03"


def test_units_are_raised_and_a_bare_number_has_none():
    assert unit("N s2/m2") == "N s<sup>2</sup>/m<sup>2</sup>"
    assert unit("1") == ""


@pytest.mark.parametrize("verdict", [Verdict.INCONCLUSIVE, Verdict.EXCLUDED])
def test_a_table_scrolls_in_a_box_of_its_own_on_a_narrow_screen(verdict):
    size = Size("angular_damping.z_n_m_s", "N m s", 1e-5, 1e-5, half90=1.6e-5, smallest_visible=1e-4, usual=1e-3)
    found = CandidateFinding("angular_damping", verdict, "", (size,), 0.0, 0.5, 0.0, 0.1, (), (), (), "")
    drawn = candidates([found])
    assert drawn.count("<table") == drawn.count("<div class='scroll'><table") == 1


def test_every_channel_and_variable_has_words_of_its_own():
    said = [words.channel(c) for c in EVERY_CHANNEL] + [words.variable(v.name) for v in VARIABLES]
    assert len(set(said)) == len(said)
    assert not any("_" in text for text in said)
    assert words.channel("M_z") == "torque about z"
    assert words.variable("v_x v_z") == "product of the velocities along x and z"


def test_every_effect_and_parameter_of_the_catalogue_has_a_name_in_words():
    catalogue = effects.catalogue()
    titles = [words.effect(name) for name in catalogue]
    assert len(set(titles)) == len(titles)
    assert not any("_" in title for title in titles)
    for effect in catalogue.values():
        names = [words.parameter(f"{effect.name}.{s.name}") for s in effect.parameters]
        assert len(set(names)) == len(names)
        assert not any("_" in name for name in names)
    assert words.effect("weak_rotor[2]") == "weak rotor (rotor 2)"
    assert words.parameter("parasitic_drag.drag_xy_kg_m") == "drag xy"
    assert words.parameter("air_density_kg_m3") == words.parameter_in_full("air_density_kg_m3") == "air density"
    assert words.parameter_in_full("centre_of_mass.x_m") == "centre of mass, x"


def test_sentences_name_effects_in_words_and_leave_the_rest_alone():
    names = ["rotor_drag_thrust", "rotor_drag_speed", "weak_rotor[1]", "pose_delay"]
    said = words.named("+ rotor_drag_thrust or weak_rotor[1]; rotor_drag_thrust_of_mine, pose_delay.delay_s", names)
    assert said == "+ rotor drag with thrust or weak rotor (rotor 1); rotor_drag_thrust_of_mine, pose_delay.delay_s"


def test_sentences_name_parameters_in_full():
    names = ["inertia_zz_kg_m2", "rotor_yaw_torque.torque_n_m_s2", "centre_of_mass.x_m", "centre_of_mass.x_m_of_mine"]
    said = words.parameters_named("inertia_zz_kg_m2 and rotor_yaw_torque.torque_n_m_s2: centre_of_mass.x_m.", names)
    assert said == "inertia zz and rotor yaw torque, torque: centre of mass, x."


def test_sentences_name_curves_in_words():
    said = words.curves_named("L against speed; F_x_world against x, T_1 against n_1.", EVERY_CHANNEL, UNIT)
    assert said == (
        "lift of every rotor against air speed; force along x of the world against place along x, "
        "thrust of rotor 1 against speed of rotor 1."
    )
    assert words.curves_named("vehicle L against v_z_of_mine", EVERY_CHANNEL, UNIT) == "vehicle L against v_z_of_mine"
    for channel in EVERY_CHANNEL:
        for variable in UNIT:
            said = words.curves_named(f"{channel} against {variable} explains more", EVERY_CHANNEL, UNIT)
            assert said == f"{words.channel(channel)} against {words.variable(variable)} explains more"
