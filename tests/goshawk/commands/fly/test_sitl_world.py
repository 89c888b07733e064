"""`goshawk sitl` flies another vehicle than its controller believes."""

import numpy as np
import pytest

import vehicle
from firmware_bridge import Sensors, controller
from firmware_bridge.closed_loop import TICK_US
from flight import InputError
from goshawk.commands.fly import sitl


def test_the_true_mass_and_rotor_are_not_the_files():
    learned = vehicle.example("rigter2019")
    truth = sitl._changed(learned, 1.05, ("2=.85", "0=1.1"))
    assert truth.mass_kg == pytest.approx(1.05 * learned.mass_kg)
    lost = [truth.value(f"weak_rotor.loss_{i}") for i in range(4)]
    assert lost == pytest.approx([-0.1, 0.0, 0.15, 0.0])
    assert sitl._changed(learned, 1.0, ()) is learned


@pytest.mark.parametrize("text", ["4=.9", "2", "2=", "=.9", "1=-0.1", "1=inf", "two=.9"])
def test_a_rotor_that_is_none_is_refused_with_the_way_out(text):
    with pytest.raises(InputError, match=r"like 2=\.85"):
        sitl._changed(vehicle.example("rigter2019"), 1.0, (text,))


def test_the_observer_finds_the_wrong_mass_of_the_simulated_vehicle():
    learned = vehicle.example("rigter2019")
    truth = sitl._changed(learned, 1.05, ())
    plant = vehicle.simulate.Plant(truth, vehicle.simulate.State(position_world_m=np.array([0.0, 0.0, 0.0])))
    flown = controller.Controller(controller.parameters_of(learned))
    sensors, rng = Sensors.typical(), np.random.default_rng(0)
    for tick in range(1, 3600):
        state = np.concatenate([
            plant.position_world_m, plant.velocity_world_m_s, plant.q_world_body, plant.rate_body_rad_s,
        ])  # fmt: skip
        command = flown.tick(
            tick * TICK_US,
            sensors.estimate(state, rng),
            specific_force_body_m_s2=plant.specific_force_body_m_s2 + rng.normal(0.0, 0.05, 3),
            rotor_speed_rad_s=plant.rotor_speed_rad_s,
        )
        if tick == 4:
            flown.command(controller.Command.ARM)
            flown.command(controller.Command.TAKE_OFF, 1.5)
        plant.step(command, TICK_US * 1e-6)
    assert flown.telemetry["observer_state"] == 2
    weight_n = learned.mass_kg * learned.gravity_m_s2
    assert flown.telemetry["disturbance_force_world_n"][2] == pytest.approx(-0.05 * weight_n, abs=0.1)
