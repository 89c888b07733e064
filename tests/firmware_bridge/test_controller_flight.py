"""Closed loop: the C controller round the SITL vehicle's plant, motor lag included."""

import numpy as np
import pytest

import vehicle
from firmware_bridge.controller import VARIANTS, Command, State, parameters_of


def test_hover_stays_where_it_took_off(flight_of):
    flight = flight_of()
    flight.hover(1.5)
    flight.run(2.0)
    position = np.array([row["true_position_m"] for row in flight.log[-500:]])
    assert np.abs(position - [0.0, 0.0, 1.5]).max() < 2e-3


def test_a_moved_start_is_approached_without_overshoot(flight_of, curves):
    flight = flight_of(start_m=(0.3, -0.2, 0.0))
    flight.start(curves.straight())
    gap = np.linalg.norm(flight.plant.position_world_m - [0.0, 0.0, 1.5])
    assert gap < 5e-3
    assert max(row["true_position_m"][2] for row in flight.log) < 1.51


@pytest.mark.parametrize(("kind", "mean_m", "worst_m"), [("figure_eight", 0.02, 0.035), ("vertical", 0.006, 0.012)])
def test_fast_paths_are_tracked_within_centimetres(flight_of, curves, kind, mean_m, worst_m):
    error = flight_of().fly(getattr(curves, kind)())
    assert error.mean() < mean_m
    assert error.max() < worst_m


def test_tracking_with_noise_and_delay_meets_the_paper(flight_of, curves):
    # Rigter et al.: 5.1 cm level at 8.5 m/s, 1.32 cm vertical at 3.1 m/s, 4.9 cm general with yaw.
    for trajectory, bar_m in (
        (curves.figure_eight(turns=1), 0.051),
        (curves.vertical(turns=2), 0.0132),
        (curves.general(turns=1), 0.049),
    ):
        flight = flight_of(noise=True, delay_s=0.01, seed=1)
        assert flight.fly(trajectory).mean() < bar_m


def test_drag_compensation_is_what_keeps_the_error_small(flight_of, curves):
    truth = vehicle.example("rigter2019")
    bare = truth.without_effect("rotor_drag_thrust").without_effect("parasitic_drag")
    with_drag = flight_of().fly(curves.figure_eight(turns=1)).mean()
    without = flight_of(truth=truth, believed=bare).fly(curves.figure_eight(turns=1)).mean()
    assert without > 5 * with_drag


def test_another_vehicle_with_other_effects_flies_too(flight_of, curves):
    hummingbird = vehicle.example("hummingbird")
    assert parameters_of(hummingbird).not_compensated == ()
    error = flight_of(truth=hummingbird).fly(curves.figure_eight(speed_m_s=5.0, turns=1))
    assert error.mean() < 0.02


def test_landing_ends_disarmed_on_the_ground(flight_of):
    flight = flight_of()
    flight.hover(1.0)
    flight.controller.command(Command.LAND)
    assert flight.run(12.0, State.DISARMED)
    assert flight.plant.position_world_m[2] < 0.06
    assert abs(flight.plant.velocity_world_m_s[2]) < 0.6
    assert (flight.log[-1]["rotor_speed_rad_s"] == 0).all()


def test_the_integrator_removes_a_wrong_mass(flight_of):
    heavy = vehicle.example("rigter2019").with_value("mass_kg", 0.78)
    believed = vehicle.example("rigter2019")

    def sag_m(**overrides: float) -> float:
        flight = flight_of(truth=heavy, believed=believed, overrides=overrides)
        flight.hover(1.5)
        flight.run(6.0)
        return abs(1.5 - flight.plant.position_world_m[2])

    assert sag_m() > 0.04
    assert sag_m(ki_z_1_s3=5.0) < 5e-3


def test_a_weak_rotor_that_is_known_is_compensated(flight_of):
    weak = vehicle.example("rigter2019").with_effect("weak_rotor", loss_0=0.15)

    def offset_m(believed: vehicle.Vehicle) -> float:
        flight = flight_of(truth=weak, believed=believed)
        flight.hover(1.5)
        flight.run(4.0)
        return float(np.linalg.norm(flight.plant.position_world_m - [0.0, 0.0, 1.5]))

    assert offset_m(weak) < 3e-3
    assert offset_m(vehicle.example("rigter2019")) > 0.02


def test_each_rung_of_the_papers_ladder_tracks_better(flight_of, curves):
    names = ["quadratic thrust, no drag", "axial BEM, rotor drag", "full BEM, all drag", "ours"]
    error = [flight_of(overrides=VARIANTS[n]).fly(curves.figure_eight(turns=1)).mean() for n in names]
    assert error == sorted(error, reverse=True)
    assert error[0] > 5 * error[-1]
