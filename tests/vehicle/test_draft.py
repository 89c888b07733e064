"""New vehicles: given values stay, estimates agree with known vehicles, foreign files are parsed and never executed."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import vehicle
from flight import FormatError, InputError
from vehicle import Parameter, commented, draft, layouts
from vehicle.draft import Known
from vehicle.importers import import_px4, import_rotorpy, import_urdf


def sheet(mass_kg: float, arm_m: float, diameter_m: float, frame: str = "x", **more: float) -> Known:
    hubs, spin = draft.layout(arm_m, frame)
    mass, radius = Parameter(mass_kg, 0.0, "kg", "given"), Parameter(diameter_m / 2.0, 0.0, "m", "given")
    return Known(mass_kg=mass, hub_body_m=hubs, spin=spin, rotor_radius_m=radius, **more)


@pytest.mark.parametrize("name", ["rigter2019", "hummingbird"])
def test_estimates_of_a_known_vehicle_hold_its_values_within_two_standard_deviations(name):
    truth = vehicle.example(name)
    arm_m = float(np.hypot(*truth.hub_body_m[0, :2]))
    made = draft.draft(sheet(truth.mass_kg, arm_m, 2.0 * truth.value("rotor_radius_m")))
    for axis in ("xx", "yy", "zz"):
        guess = made.parameter(f"inertia_{axis}_kg_m2")
        assert abs(guess.value - truth.value(f"inertia_{axis}_kg_m2")) < 2.0 * guess.std
    hover = 951.0 if name == "rigter2019" else np.sqrt(0.5 * 9.80665 / 4 / 5.57e-6)  # the paper's; RotorPy's law
    k = made.parameter("thrust_quadratic.k_n_s2")
    assert abs(k.value - truth.mass_kg * 9.80665 / (4.0 * hover**2)) < 2.0 * k.std
    torque = made.parameter("rotor_yaw_torque.torque_n_m_s2")
    assert abs(torque.value - truth.value("rotor_yaw_torque.torque_n_m_s2")) < 2.0 * torque.std


@settings(suppress_health_check=[HealthCheck.too_slow])  # a busy machine is no fault
@given(
    kg_m2=st.floats(5.0, 300.0),
    arm=st.floats(0.05, 0.5),
    frame=st.sampled_from(layouts.FRAMES),
    loading=st.floats(0.4, 1.2),
)
def test_every_sensible_data_sheet_gives_a_vehicle_that_can_hover_and_its_file_reads_back(
    tmp_path_factory, kg_m2, arm, frame, loading
):
    mass = kg_m2 * (loading * arm) ** 2  # the example vehicle weighs 43 times the square of its propellers' diameter
    made = draft.draft(sheet(mass, arm, loading * arm, frame))
    k = made.value("thrust_quadratic.k_n_s2")
    hover = np.sqrt(mass * 9.80665 / (made.rotors * k))
    assert made.limits.rotor_speed_min_rad_s < hover < made.limits.rotor_speed_max_rad_s
    inertia = [made.value(f"inertia_{a}_kg_m2") for a in ("xx", "yy", "zz")]
    assert inertia[2] <= inertia[0] + inertia[1]  # true of every rigid body
    path = tmp_path_factory.mktemp("made") / "v.toml"
    commented.write(path, made)
    read = vehicle.load(path)
    assert vehicle.vehicle_hash(read) == vehicle.vehicle_hash(made)
    assert dict(read.parameters) == dict(made.parameters)


def test_a_known_hover_speed_lifts_exactly_the_weight():
    made = draft.draft(sheet(0.7, 0.125, 0.127, hover_rad_s=951.0))
    assert 4.0 * made.value("thrust_quadratic.k_n_s2") * 951.0**2 == pytest.approx(0.7 * 9.80665, rel=1e-3)


def test_flat_frames_put_the_hubs_on_a_circle_counter_clockwise_with_neighbours_turning_opposite_ways():
    for frame in ("x", "+", "hex", "hex+", "octo", "octo+"):
        hubs, spin = draft.layout(0.2, frame)
        assert np.allclose(np.linalg.norm(hubs, axis=1), 0.2, atol=1e-6)
        turn = np.cross(hubs[:, :2], np.roll(hubs[:, :2], -1, axis=0))
        assert (turn > 0.0).all()
        assert (spin * np.roll(spin, 1) == -1.0).all()
        assert spin[0] == -1.0


def test_what_is_not_known_is_named_with_the_option_that_gives_it():
    with pytest.raises(InputError, match=r"--mass.*--arm.*--prop-diameter"):
        draft.draft(Known())


def test_a_propeller_too_small_for_the_weight_is_refused():
    with pytest.raises(InputError, match="does not lift its weight"):
        draft.draft(sheet(0.7, 0.1, 0.127, rotor_speed_max_rad_s=500.0))
    with pytest.raises(InputError, match=r"tips at .* faster than sound"):
        draft.draft(sheet(700.0, 0.125, 0.127))
    with pytest.raises(InputError, match=r"C_T of .* \(rpm, not rad/s\)"):
        draft.draft(sheet(0.7, 0.125, 0.127, hover_rad_s=100.0))


PX4 = """# Onboard parameters for Vehicle 1
# Vehicle-Id Component-Id Name Value Type
1	1	CA_ROTOR0_KM	0.05	9
1	1	CA_ROTOR0_PX	0.09	9
1	1	CA_ROTOR0_PY	0.11	9
1	1	CA_ROTOR1_PX	-0.09	9
1	1	CA_ROTOR1_PY	-0.11	9
1	1	CA_ROTOR2_KM	-0.05	9
1	1	CA_ROTOR2_PX	0.09	9
1	1	CA_ROTOR2_PY	-0.11	9
1	1	CA_ROTOR3_KM	-0.05	9
1	1	CA_ROTOR3_PX	-0.09	9
1	1	CA_ROTOR3_PY	0.11	9
1	1	CA_ROTOR_COUNT	4	6
"""


def test_px4_rotors_come_in_its_order_with_y_to_the_left(tmp_path):
    path = tmp_path / "quad.params"
    path.write_text(PX4)
    known = import_px4.read(path)
    assert known.hub_body_m.tolist() == [[0.09, -0.11, 0.0], [-0.09, 0.11, 0.0], [0.09, 0.11, 0.0], [-0.09, -0.11, 0.0]]
    assert known.spin.tolist() == [1.0, 1.0, -1.0, -1.0]  # front right and rear left counter-clockwise, as PX4 draws it
    assert known.yaw_torque_to_thrust_m is None  # 0.05 is PX4's default, not a measurement
    assert draft.missing(known) != []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("CA_ROTOR_COUNT	4", "CA_ROTOR_COUNT	3"), "4 to 8 rotors"),
        (("-0.05", "0.05"), "two of each sign"),
        (("CA_ROTOR", "XX_ROTOR"), "has no CA_ROTOR0_PX"),
        (("0.09", "nan"), "four different places"),
        (("0.11", "wide"), "line 5: 'wide'"),
    ],
)
def test_px4_parameters_that_make_no_quadrotor_are_refused(tmp_path, change, words):
    path = tmp_path / "quad.params"
    path.write_text(PX4.replace(*change))
    with pytest.raises((InputError, FormatError), match=words):
        import_px4.read(path)


def test_rotorpy_hummingbird_is_the_example_that_comes_with_the_package():
    rotorpy = pytest.importorskip("rotorpy", reason="RotorPy is a development dependency")
    from pathlib import Path

    made = draft.draft(import_rotorpy.read(Path(rotorpy.__file__).parent / "vehicles" / "hummingbird_params.py"))
    example = vehicle.example("hummingbird")
    same_order = [0, 3, 2, 1]  # the example goes counter-clockwise, RotorPy clockwise
    assert np.allclose(made.hub_body_m[same_order], example.hub_body_m)
    assert (made.spin[same_order] == example.spin).all()
    assert set(made.effects) == set(example.effects)
    for name in vehicle.specs(example):
        assert made.value(name) == pytest.approx(example.value(name)), name


def rotorpy_file(tmp_path, **changes: str):
    values = {
        "mass": "0.5", "Ixx": "3e-3", "Iyy": "3e-3", "Izz": "6e-3", "k_eta": "5e-6", "k_m": "1e-7", "tau_m": "0.01",
        "rotor_radius": "0.1", "rotor_directions": "np.array([1, -1, 1, -1])",
        "rotor_pos": "{'r1': d*np.array([.7,.7,0]), 'r2': d*np.array([.7,-.7,0]),"
        " 'r3': d*np.array([-.7,-.7,0]), 'r4': d*np.array([-.7,.7,0])}",
    } | changes  # fmt: skip
    path = tmp_path / "v_params.py"
    path.write_text(
        "import numpy as np\nd = 0.17\nquad_params = {" + ", ".join(f"'{k}': {v}" for k, v in values.items()) + "}"
    )
    return path


@pytest.mark.parametrize(
    "harm",
    ["__import__('os').system('touch harm')",
     "open('harm', 'w').close()", "[x for x in (1,)]", "9**9**9**9", "'a' * 10**12",
     "np.array([1]) / 0 * None", "np.sqrt(-1)", "np.load('x')", "(lambda: 1)()", "d.__class__", "float('nan')"],
)  # fmt: skip
def test_a_rotorpy_file_is_never_run(tmp_path, monkeypatch, harm):
    monkeypatch.chdir(tmp_path)
    with pytest.raises((FormatError, InputError)):
        import_rotorpy.read(rotorpy_file(tmp_path, mass=harm))
    assert not (tmp_path / "harm").exists()


URDF = """<robot name="two parts">
  <link name="base"><inertial><mass value="0.6"/><inertia ixx="0.002" iyy="0.002" izz="0.003"/></inertial></link>
  <link name="battery"><inertial><origin xyz="0 0 0.01"/><mass value="0.2"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/>
  </inertial></link>
  <joint name="b" type="fixed"><parent link="base"/><child link="battery"/><origin xyz="0 0 0.03"/></joint>
  PROPS
</robot>"""


def urdf(tmp_path, text: str = URDF, places: str = "0.1 0.1,-0.1 0.1,-0.1 -0.1,0.1 -0.1"):
    props = "".join(
        f'<link name="prop{i}"/><joint name="j{i}" type="continuous"><parent link="base"/><child link="prop{i}"/>'
        f'<origin xyz="{place} 0.02"/></joint>'
        for i, place in enumerate(places.split(","))
    )
    path = tmp_path / "q.urdf"
    path.write_text(text.replace("PROPS", props))
    return path


def test_a_urdf_becomes_one_body_about_its_common_centre_of_mass(tmp_path):
    known = import_urdf.read(urdf(tmp_path))
    assert known.mass_kg.value == pytest.approx(0.8)
    centre_m = 0.2 * 0.04 / 0.8
    assert known.hub_body_m[0] == pytest.approx([0.1, 0.1, 0.02 - centre_m])
    steiner = 0.6 * centre_m**2 + 0.2 * (0.04 - centre_m) ** 2
    assert known.parameters["inertia_xx_kg_m2"].value == pytest.approx(0.0021 + steiner)
    assert known.parameters["inertia_zz_kg_m2"].value == pytest.approx(0.0031)
    assert known.spin.tolist() == [-1.0, 1.0, -1.0, 1.0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('<!DOCTYPE r [<!ENTITY a "aaaa">]>' + URDF, "declares XML entities"),
        (URDF.replace("</robot>", ""), "not valid XML"),
        (URDF.replace("PROPS", ""), "four links with prop or rotor"),
        (URDF.replace('"0.6"', '"-1"'), "zero or more"),
        (URDF.replace('"0.6"', '"inf"'), "not a finite number"),
        (URDF.replace('parent link="base"', 'parent link="battery"'), "form a ring"),
        ("<sdf/>", "no URDF"),
    ],
)
def test_a_urdf_that_is_damaged_or_harmful_is_refused(tmp_path, text, words):
    with pytest.raises((FormatError, InputError), match=words):
        import_urdf.read(urdf(tmp_path, text))
