"""Effects of the user's own, in Python, in the batched loop: as the catalogue's, only slower."""

from dataclasses import replace

import numpy as np
import pytest

import preflight
from firmware_bridge.controller import parameters_of
from flight import InputError
from preflight import core, draws
from tests.preflight.conftest import EXACT, Wall, there_and_back
from tests.preflight.test_core import IDLE, WINDY
from vehicle import Vehicle

DRAG = """from vehicle.effects.base import Effect, Spec, Stage, magnitude

def apply(flow, p):
    v = flow.velocity_m_s
    flow.force_n[0] -= p.level * magnitude(v[0]) * v[0]
    flow.force_n[1] -= p.level * magnitude(v[1]) * v[1]
    flow.force_n[2] -= p.up * magnitude(v[2]) * v[2]

EFFECT = Effect(name="own_drag", number=901, stage=Stage.FORCE, apply=apply, parameters=(
    Spec("level", "N s2/m2", prior=0.01, bounds=(0.0, 1.0), planted=0.0),
    Spec("up", "N s2/m2", prior=0.02, bounds=(0.0, 1.0), planted=0.0)),
    law="F_i = -c_i |v_i| v_i", source="this test", channel="F_x F_y F_z", regressor="|v_i| v_i", excited_by=())
"""
SHORT = there_and_back(1.0, 1.0)


@pytest.fixture(scope="module")
def own(drone, tmp_path_factory) -> Vehicle:
    """The example, its airframe's drag in a file of the user's own."""
    file = tmp_path_factory.mktemp("own") / "own_drag.py"
    file.write_text(DRAG)
    level, up = (drone.value(f"parasitic_drag.drag_{axis}_kg_m") for axis in ("xy", "z"))
    return drone.without_effect("parasitic_drag").with_effect_file(file, level=level, up=up)


def flown(drone: Vehicle, controller: Vehicle, uncertainty: preflight.Uncertainty, count: int = 2) -> core.Flown:
    form = draws.flown_form(drone)
    loop = core.Loop(form, SHORT, parameters_of(controller), clearance_m=1.0)
    drawn = draws.draw(form, loop.names, uncertainty, count, seed=3)
    return loop.fly(drawn.values, drawn.rows, seed=3)


def test_a_law_in_python_flies_as_the_same_law_compiled(drone, own):
    compiled, called = (flown(each, drone, WINDY) for each in (drone, own))
    on = np.isfinite(compiled.error_m)
    assert compiled.position_world_m[on] == pytest.approx(called.position_world_m[on], abs=1e-4)
    without = flown(drone.without_effect("parasitic_drag"), drone, WINDY)
    assert np.abs(without.position_world_m[on] - called.position_world_m[on]).max() > 1e-3


def test_its_parameters_are_drawn_too_and_each_flight_has_its_own(own):
    spread = draws.flown_form(own.with_value("own_drag.level", 0.01, std=0.005))
    loop = core.Loop(spread, SHORT, parameters_of(own), clearance_m=1.0)
    drawn = draws.draw(spread, loop.names, replace(EXACT, wind_m_s=6.0, noise_ratio=0.0), 2, seed=3)
    level = drawn.values[:, loop.names.index("own_drag.level")]
    assert level[0] != level[1]
    values, rows = drawn.values[[0, 0]], drawn.rows[[0, 0]]
    same = loop.fly(values, rows, seed=3, numbers=np.zeros(2, int))
    assert np.array_equal(same.position_world_m[0], same.position_world_m[1], equal_nan=True)
    values[1] = drawn.values[0]
    values[1, loop.names.index("own_drag.level")] = 3.0 * level[0]
    other = loop.fly(values, rows, seed=3, numbers=np.zeros(2, int))
    assert np.array_equal(other.position_world_m[0], same.position_world_m[0], equal_nan=True)
    assert np.nanmax(np.abs(other.position_world_m[1] - same.position_world_m[1])) > 1e-3


def test_a_preflight_says_what_makes_it_slow(own):
    options = preflight.Options(flights=2, risk=0.5, uncertainty=EXACT, explain=False)
    found = preflight.fly(preflight.Scenario(own, SHORT, Wall(2.0), radius_m=0.2, clearance_m=1.0), options)
    assert len(found.record) == 2
    assert any("(own_drag)" in sentence for sentence in found.assumed)


def test_one_on_mass_is_refused_by_name_with_the_way_out(drone, tmp_path):
    (tmp_path / "idle.py").write_text(IDLE)
    idle = drone.with_effect_file(tmp_path / "idle.py")
    with pytest.raises(InputError, match=r"own on mass or motors \(idle\).*goshawk sitl"):
        flown(idle, drone, EXACT)


def test_one_that_fails_in_flight_is_told_in_a_sentence(drone, tmp_path):
    slow = "def _slow(v):\n    1.0 / max(0.0, 0.1 - abs(v[0]))\n\ndef apply"
    law = DRAG.replace("own_drag", "own_failing").replace("901", "902").replace("def apply", slow)
    file = tmp_path / "own_failing.py"
    file.write_text(law.replace("    v = flow.velocity_m_s\n", "    v = flow.velocity_m_s\n    _slow(v)\n"))
    with pytest.raises(InputError, match=r"effect own_failing failed: ZeroDivisionError: .*; mend .*own_failing.py"):
        flown(drone.with_effect_file(file), drone, WINDY)
