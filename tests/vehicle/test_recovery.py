"""Every effect shows itself: planted on the manoeuvres that excite it, its values come back."""

import numpy as np
import pytest

from vehicle import effects, self_test


@pytest.mark.parametrize("name", effects.catalogue())
def test_a_planted_value_is_recovered(name):
    recovery = self_test.run(name, rng=np.random.default_rng(11))
    assert recovery.passed, f"planted {recovery.planted}, found {recovery.found} +- {recovery.std}"


def test_the_test_can_fail():
    good = self_test.run("angular_damping", rng=np.random.default_rng(11))
    off = self_test.Recovery(good.names, good.planted + 5 * good.std, good.found, good.std)
    assert not off.passed
    unseen = self_test.Recovery(good.names, good.planted, good.planted, 10 * np.abs(good.planted))
    assert not unseen.passed
