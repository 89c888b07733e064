"""The true laws of campaigns of another form, as effects: what `blind_forms` flies, to rounding."""

import sys
from pathlib import Path

import numpy as np
import pytest

from vehicle import effects
from vehicle.effects.base import Flow, Values

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"
COUNT = 40


@pytest.fixture(scope="module", autouse=True)
def benchmarks_on_path():
    sys.path.insert(0, str(BENCHMARKS))
    yield
    sys.path.remove(str(BENCHMARKS))


@pytest.fixture
def own_effects():
    yield
    effects.forget_files(effects.from_files())


def flown():
    """The same flight as air of the truth and as flow of an effect."""
    from blind_flight import Air

    rng = np.random.default_rng(7)
    velocity, rate = 3.0 * rng.standard_normal((3, COUNT)), 2.0 * rng.standard_normal((3, COUNT))
    speed, height = rng.uniform(200.0, 700.0, (4, COUNT)), rng.uniform(0.05, 1.0, COUNT)
    hub = np.array([[0.2, -0.2, -0.2, 0.2], [0.2, 0.2, -0.2, -0.2], [0.0, 0.0, 0.0, 0.0]])[:, :, None]
    position = np.stack([height, height, height])
    still, spin = np.zeros((4, COUNT)), np.array([[1.0], [-1.0], [1.0], [-1.0]])
    air = Air(0.0, position, np.zeros((3, 3, COUNT)), velocity, rate, speed, still, hub, spin)
    flow = Flow(velocity, rate, speed, hub, spin, 0.1, 1.2, height_m=height)
    flow.thrust_n += 7e-6 * speed**2
    return air, flow


def true_values(extra, law) -> dict[str, float]:
    """The drawn sizes of a law, in the order in which the effect names them."""
    numbers = [getattr(extra, name) for name in extra.__dataclass_fields__ if name != "rotor"]
    return dict(zip(law.parameters, np.concatenate([np.atleast_1d(n) for n in numbers]).tolist(), strict=True))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["damping", "drag", "cushion", "lift", "moment", "sink", "wake", "rotor"])
def test_each_law_is_the_one_that_is_flown(kind: str, seed: int, tmp_path: Path, own_effects: None):
    import blind_forms
    import form_laws

    form = blind_forms.FORMS[kind](np.random.default_rng(seed), 0.1)
    law = form_laws.LAWS[form.law]
    file = tmp_path / "true_form.py"
    file.write_text(form_laws.text(law, "true_form", form.variables[0].removeprefix("n_")))
    air, flow = flown()
    before = flow.thrust_n.copy()
    effects.load_file(file).apply(flow, Values(**true_values(form.extra, law)))
    thrust = form.extra.thrust(air, before.copy())
    force, torque = form.extra.wrench(air, thrust) or (np.zeros((3, COUNT)), np.zeros((3, COUNT)))
    assert flow.thrust_n == pytest.approx(thrust)
    assert flow.force_n == pytest.approx(force, abs=1e-9)
    assert flow.torque_n_m == pytest.approx(torque, abs=1e-12)
    assert np.abs(thrust - before).max() + np.abs(force).max() + np.abs(torque).max() > 1e-4


def test_every_law_that_a_campaign_may_fly_has_its_effect():
    import blind_forms
    import form_laws

    drawn = {draw(np.random.default_rng(seed), 0.1).law for draw in blind_forms.FORMS.values() for seed in range(8)}
    assert drawn == set(form_laws.LAWS)
