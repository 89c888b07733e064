"""What is drawn is what is known: colours follow clearance."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gcs_web import scene


@settings(deadline=None)  # the first call loads the colour scales
@given(st.floats(-1.0, 5.0), st.floats(-1.0, 5.0))
def test_more_clearance_is_never_brighter(a, b):
    """Brightness alone carries the order, for those who see no colours."""
    low, high = sorted([a, b])
    brightness = scene.clearance_colours(np.array([low, high]), 0.3) @ [0.2126, 0.7152, 0.0722]
    assert brightness[1] <= brightness[0] + 1e-9


def test_unknown_clearance_is_drawn_as_the_worst():
    colours = scene.clearance_colours(np.array([np.nan, -1.0, 0.3]), 0.3)
    np.testing.assert_array_equal(colours[0], colours[1])
    np.testing.assert_array_equal(colours[0], colours[2])
