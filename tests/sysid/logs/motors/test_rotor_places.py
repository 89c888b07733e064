"""Columns are taken by the places of a firmware's motors, unless the flight itself shows their order."""

from dataclasses import replace

import numpy as np
import pytest

from flight import FlightLog
from flight.flight_log import COLUMNS
from sysid.logs.check import check_log
from sysid.logs.fix import fix
from sysid.logs.motors import rotor_places

SPEEDS = COLUMNS["rotor_speed_rad_s"]
FIRMWARES = (rotor_places.CRAZYFLIE, rotor_places.BETAFLIGHT, rotor_places.ARDUPILOT)
SIGNS = {"front": 1.0, "rear": -1.0, "left": 1.0, "right": -1.0}


def hovering(log: FlightLog) -> FlightLog:
    """A log that shows nothing of the order: it does not turn."""
    rng = np.random.default_rng(0)
    still = {name: 0.01 * rng.standard_normal(len(log)) for name in COLUMNS["rate_body_rad_s"]}
    kept = {name: values for name, values in log.columns.items() if name in (*SPEEDS, "time_s")}
    return FlightLog({**kept, **still}, {})


def at_places(vehicle, places: tuple[str, ...]):
    hubs = np.array([[0.1 * SIGNS[word] for word in place.split()] + [0.0] for place in places])
    return replace(vehicle, hub_body_m=hubs)


@pytest.mark.parametrize("places", FIRMWARES)
def test_a_firmwares_columns_are_taken_by_place(log, truth, places):
    one = rotor_places.with_places(hovering(log), places)
    assert not [f for f in check_log(one, at_places(truth, places)).findings if f.what == "rotor order"]
    mended = fix(one, truth)
    if rotor_places.order(one, truth) != (0, 1, 2, 3):
        (done,) = mended.done
        assert "motors are " + ", ".join(places) in done
    assert tuple(mended.log.metadata[rotor_places.KEY]) == rotor_places.of_vehicle(truth)
    for place, name in zip(rotor_places.of_vehicle(truth), SPEEDS, strict=True):
        assert np.array_equal(mended.log.columns[name], one.columns[SPEEDS[places.index(place)]])


@pytest.mark.parametrize("places", FIRMWARES)
def test_a_flight_that_shows_its_order_is_believed_before_its_firmware(log, truth, places):
    told = rotor_places.with_places(log, places)
    assert rotor_places.order(told, truth) != (0, 1, 2, 3)
    assert not [f for f in check_log(told, truth).findings if f.what == "rotor order"]


def test_places_that_yaw_contradicts_are_not_taken(log, truth):
    """Roll and pitch show nothing; yaw shows that the columns are in the file's order, or turned by half a turn."""
    rng = np.random.default_rng(0)
    shaken = {name: rng.standard_normal(len(log)) for name in COLUMNS["rate_body_rad_s"][:2]}
    pose = [name for name in log.columns if name.startswith(("position", "q_world"))]
    rest = {name: values for name, values in log.columns.items() if name not in pose}
    one = FlightLog({**rest, **shaken}, {})
    mirrored = tuple(rotor_places.of_vehicle(truth)[k] for k in (3, 2, 1, 0))
    turned = tuple(rotor_places.of_vehicle(truth)[k] for k in (2, 3, 0, 1))
    assert not check_log(rotor_places.with_places(one, mirrored), truth).findings
    (found,) = check_log(rotor_places.with_places(one, turned), truth).findings
    assert found.repair is not None
    assert found.repair.order == (2, 3, 0, 1)


def test_a_vehicle_on_its_axes_or_a_log_of_another_stack_says_nothing(log, truth):
    plus = replace(truth, hub_body_m=np.array([[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [-0.1, 0.0, 0.0], [0.0, -0.1, 0.0]]))
    assert rotor_places.of_vehicle(plus) == ("front", "left", "rear", "right")
    assert rotor_places.order(rotor_places.with_places(log, rotor_places.CRAZYFLIE), plus) is None
    assert rotor_places.order(log, truth) is None
