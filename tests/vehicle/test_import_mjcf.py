"""A MuJoCo model: masses and inertias by formula, rotors by their motors; tilted ones refused, also of PX4."""

import numpy as np
import pytest

from flight import FormatError, InputError
from vehicle.importers import import_mjcf, import_px4

X2 = """<mujoco model="x 2">
  <default><default class="x2"><geom mass="0"/>
    <default class="visual"><geom type="mesh"/></default>
    <default class="rotor"><geom type="ellipsoid" size=".13 .13 .01"/></default></default></default>
  <worldbody><light pos="0 0 1"/><body name="x2" pos="0 0 0.1" childclass="x2"><freejoint/>
    <geom class="visual" mesh="m"/>
    <geom class="rotor" pos="-.14 -.18 .05" mass=".25"/><geom class="rotor" pos="-.14 .18 .05" mass=".25"/>
    <geom class="rotor" pos=".14 .18 .05" mass=".25"/><geom class="rotor" pos=".14 -.18 .05" mass=".25"/>
    <site name="t1" pos="-.14 -.18 .05"/><site name="t2" pos="-.14 .18 .05"/>
    <site name="t3" pos=".14 .18 .05"/><site name="t4" pos=".14 -.18 .05"/>
    <body name="core"><inertial pos="0 0 -.1" mass=".5" diaginertia="1e-3 2e-3 3e-3"/></body>
  </body></worldbody>
  <actuator>
    <motor name="m1" site="t1" gear="0 0 1 0 0 -.02"/><motor name="m2" site="t2" gear="0 0 1 0 0 .02"/>
    <motor name="m3" site="t3" gear="0 0 1 0 0 -.02"/><motor name="m4" site="t4" gear="0 0 1 0 0 .02"/>
  </actuator></mujoco>"""


def _read(tmp_path, text: str):
    (tmp_path / "x.xml").write_text(text)
    return import_mjcf.read(tmp_path / "x.xml")


def test_masses_inertias_and_rotors_are_those_of_the_model(tmp_path):
    known = _read(tmp_path, X2)
    assert known.mass_kg is not None
    assert known.mass_kg.value == pytest.approx(1.5)
    assert known.hub_body_m is not None
    np.testing.assert_allclose(known.hub_body_m[:, 2], 0.05, atol=1e-9)  # the centre of mass is at z = 0
    assert known.spin is not None
    assert known.spin.tolist() == [1.0, -1.0, 1.0, -1.0]  # a positive twist of the body: a clockwise rotor
    assert known.yaw_torque_to_thrust_m == pytest.approx(0.02)
    disk = 0.25 / 5.0 * (0.13**2 + 0.01**2)
    xx = 4.0 * (disk + 0.25 * (0.18**2 + 0.05**2)) + 1e-3 + 0.5 * 0.1**2
    assert known.parameters["inertia_xx_kg_m2"].value == pytest.approx(xx)


def test_a_model_without_rotors_asks_for_the_arm(tmp_path):
    known = _read(tmp_path, X2[: X2.index("<actuator>")] + "</mujoco>")
    assert known.hub_body_m is None
    assert "no four motors" in known.notes[0]


def test_rotors_that_push_aside_are_refused_and_a_lean_of_px4_is_kept(tmp_path):
    with pytest.raises(InputError, match="pushes along"):
        _read(tmp_path, X2.replace('gear="0 0 1 0 0 -.02"', 'gear="0 0.3 1 0 0 -.02"', 1))
    places = [(0.1, 0.1), (-0.1, -0.1), (0.1, -0.1), (-0.1, 0.1)]
    lines = [f"CA_ROTOR{i}_P{a} {v}\n" for i, place in enumerate(places) for a, v in zip("XY", place, strict=True)]
    lines += [f"CA_ROTOR{i}_KM {0.05 if i < 2 else -0.05}\n" for i in range(4)]
    (tmp_path / "p.params").write_text("".join(lines))
    assert import_px4.read(tmp_path / "p.params").hub_body_m is not None
    (tmp_path / "p.params").write_text("".join([*lines, "CA_ROTOR0_AX 0.3\n"]))
    axis = import_px4.read(tmp_path / "p.params").axis_body
    np.testing.assert_allclose(axis, [[0.3 / 1.09**0.5, 0.0, 1.0 / 1.09**0.5], *[[0.0, 0.0, 1.0]] * 3])
    (tmp_path / "p.params").write_text("".join([*lines, "CA_ROTOR0_AX 2.0\n"]))
    with pytest.raises(InputError, match="push upwards"):
        import_px4.read(tmp_path / "p.params")


def test_what_is_no_model_is_refused(tmp_path):
    for wrong in (
        "<robot/>",
        "<mujoco/>",
        X2.replace('mass=".5"', 'mass="half"'),
        X2.replace('mass=".25"', "", 1)[:-9],
    ):
        with pytest.raises((InputError, FormatError), match=r"x\.xml"):
            _read(tmp_path, wrong)
