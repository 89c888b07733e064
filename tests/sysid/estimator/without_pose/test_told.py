"""What a fit without a pose tells besides its parameters."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from sysid.estimator.flights.clocks import Clock
from sysid.estimator.without_pose import told


@pytest.mark.parametrize(
    ("late_s", "std_s", "named", "stream", "said"),
    [
        (0.0085, 0.0003, False, "accelerometer", True),
        (0.0075, 0.0003, False, "accelerometer", False),  # twins' inertias were 1 % small then
        (0.0085, 0.003, False, "accelerometer", False),  # not surely late
        (-0.0085, 0.0003, False, "accelerometer", False),
        (0.0085, 0.0003, True, "accelerometer", False),
        (0.0085, 0.0003, False, "rotor speed command", False),
    ],
)
def test_a_late_accelerometer_is_told_of_a_log_that_names_no_low_pass(late_s, std_s, named, stream, said):
    flight = SimpleNamespace(name="a", accelerometer_low_pass=(160.0, 0.7) if named else None)
    clock = Clock(stream, "gyro", "a", late_s, std_s)
    found = told.unnamed_low_pass(cast(Any, [flight]), [clock])
    assert bool(found) is said
    assert not said or found[0].startswith("a: accelerometer is 8 ms late: its low-pass makes inertias too small")
