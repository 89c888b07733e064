"""Vehicle files: a saved vehicle loads equal, and a wrong file is refused with the reason."""

import numpy as np
import pytest

import vehicle
from flight import FormatError, InputError
from flight.frames import GRAVITY_M_S2
from vehicle import commented


@pytest.mark.parametrize("name", ["rigter2019", "hummingbird"])
def test_a_saved_vehicle_loads_equal(tmp_path, name):
    before = vehicle.example(name).with_value("mass_kg", 0.8, std=0.01, source="scale")
    vehicle.save(tmp_path / "v.toml", before)
    after = vehicle.load(tmp_path / "v.toml")
    assert after.parameters == before.parameters
    assert after.effects == before.effects
    assert after.limits == before.limits
    np.testing.assert_array_equal(after.hub_body_m, before.hub_body_m)
    assert vehicle.vehicle_hash(after) == vehicle.vehicle_hash(before)


def test_the_hash_follows_the_values_but_not_the_notes():
    base = vehicle.example()
    noted = base.with_value("mass_kg", base.mass_kg, source="another scale")
    assert vehicle.vehicle_hash(noted) == vehicle.vehicle_hash(base)
    assert vehicle.vehicle_hash(base.with_value("mass_kg", 0.71)) != vehicle.vehicle_hash(base)
    assert vehicle.vehicle_hash(base.with_limits(speed_m_s=3.0)) != vehicle.vehicle_hash(base)


def test_gravity_is_kept_and_standard_where_a_file_does_not_give_it(tmp_path):
    base, file = vehicle.example(), tmp_path / "v.toml"
    for write in (vehicle.save, vehicle.commented.write):
        write(file, base.with_gravity(9.78))
        assert vehicle.load(file).gravity_m_s2 == 9.78
    vehicle.save(file, base)
    file.write_text("".join(line for line in file.read_text().splitlines(True) if not line.startswith("gravity")))
    assert vehicle.load(file).gravity_m_s2 == GRAVITY_M_S2
    assert vehicle.vehicle_hash(vehicle.load(file)) == vehicle.vehicle_hash(base)
    assert vehicle.vehicle_hash(base.with_gravity(9.78)) != vehicle.vehicle_hash(base), "a plan must be checked again"
    for wrong in (981.0, 0.0, float("nan")):
        with pytest.raises(InputError, match=r"between 9\.76 and 9\.84 m/s2"):
            base.with_gravity(wrong)


def test_hover_plan_and_simulation_follow_gravity():
    """Squared rotor speeds in hover are in proportion to it, and at these speeds a vehicle sinks where it is larger."""
    low, high = (vehicle.example().with_gravity(g) for g in (9.765, 9.835))
    ratio = 9.835 / 9.765
    simple = [v.without_effect("thrust_bem").with_effect("thrust_quadratic", k_n_s2=2e-6) for v in (low, high)]
    hover = [vehicle.invert.hover(v) for v in simple]
    np.testing.assert_allclose((hover[1] / hover[0]) ** 2, ratio, rtol=1e-9)
    still, none = np.zeros((1, 1, 3)), (np.zeros((1, 1)), np.zeros((1, 1)))
    held = [vehicle.flatness.at_nodes(v, still, still, np.zeros((1, 1)), none, np.ones(1))[0, 0, 4:] for v in simple]
    np.testing.assert_allclose(held, np.stack(hover), rtol=1e-6)
    falls = []
    for v in simple:
        fleet = vehicle.simulate.Fleet(v, [vehicle.simulate.hovering(simple[0], np.zeros(3))])
        fleet.step(hover[0][None], 0.5)
        falls.append(fleet.velocity_world_m_s[0, 2])
    assert falls[1] - falls[0] == pytest.approx(-0.5 * (9.835 - 9.765), rel=0.02)


def test_the_papers_vehicle_hovers_at_the_papers_rotor_speed():
    rpm = vehicle.invert.hover(vehicle.example("rigter2019")).mean() * 60 / (2 * np.pi)
    assert rpm == pytest.approx(9085, abs=3)  # g = 9.81 instead of 9.80665 alone makes 1.6


def test_adding_and_removing_an_effect_is_a_round_trip():
    base = vehicle.example().without_effect("rotor_drag_thrust")
    back = base.with_effect("rotor_drag_thrust", drag_s_m=0.01).without_effect("rotor_drag_thrust")
    assert back.effects == base.effects
    assert back.parameters == base.parameters


def test_an_effect_is_inserted_at_its_stage():
    base = vehicle.example().without_effect("thrust_bem").with_effect("thrust_quadratic", k_n_s2=2e-6)
    assert base.effects.index("thrust_quadratic") < base.effects.index("parasitic_drag")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("spin = [-1, 1, -1, 1]", "spin = [-1, 1, 0, 1]"), "spins"),
        (("value = 0.70", "value = -0.70"), "mass_kg is -0.7"),
        (('unit = "kg"', 'unit = "g"'), "given in 'g'"),
        (('"thrust_bem", ', ""), "no active effect uses"),
        (('"thrust_bem"', '"thrust_bam"'), "no effect named 'thrust_bam'"),
        (("version = 1", "version = 2"), "update Goshawk"),
        (("speed_m_s = 10.5", "spede_m_s = 10.5"), "unknown limits spede_m_s"),
        (("spin =", "thrust_axis = [[0, 0, 1]]\nspin ="), "rotors has thrust_axis, .* near it: thrust_axis_body"),
        (("spin =", "spins = [1]\nspin ="), "rotors has spins, .* near it: spin"),
    ],
)
def test_a_wrong_file_is_refused_with_the_reason(tmp_path, change, message):
    vehicle.save(tmp_path / "v.toml", vehicle.example())
    from importlib import resources

    text = (resources.files("vehicle") / "examples" / "rigter2019.toml").read_text()
    assert change[0] in text
    (tmp_path / "v.toml").write_text(text.replace(*change, 1))
    with pytest.raises(FormatError, match=message):
        vehicle.load(tmp_path / "v.toml")


def test_unknown_names_are_refused_with_the_known_ones():
    with pytest.raises(InputError, match="rigter2019"):
        vehicle.example("eagle")
    with pytest.raises(InputError, match="mass_kg"):
        vehicle.example().with_value("mass", 1.0)
    with pytest.raises(InputError, match="drag_s_m"):
        vehicle.example().with_effect("rotor_drag_thrust", drag=1.0)
    with pytest.raises(InputError, match="positive"):
        vehicle.example().with_limits(speed_m_s=-1.0)


def test_limits_come_back_as_they_were_set(tmp_path):
    limited = vehicle.example().with_limits(speed_m_s=3.25, acceleration_m_s2=4.5, tilt_rad=0.5)
    for drone in (limited, limited.with_limits(jerk_m_s3=40.0)):
        for write in (vehicle.save, commented.write):
            write(tmp_path / "v.toml", drone)
            assert vehicle.load(tmp_path / "v.toml").limits == drone.limits
            assert ("jerk" in (tmp_path / "v.toml").read_text()) == (drone.limits.jerk_m_s3 is not None)
    assert limited.limits != vehicle.example().limits
