"""MAVSDK, the library that most ground programs are built on, finds the vehicle and reads where it is."""

import numpy as np
import pytest

from firmware_bridge.dialect.generated.messages import Command, MissionState
from flight import frames
from tests.waiting import PATIENCE_S, until

mavsdk = pytest.importorskip("mavsdk", reason="MAVSDK is a development dependency")
telemetry = pytest.importorskip("mavsdk.plugins.telemetry", reason="this needs MAVSDK 4, which runs without a server")


def test_mavsdk_finds_the_vehicle_and_reads_its_pose_in_the_air(serve, dial):
    served = serve(speed=2.0)
    link = dial(served)
    role = mavsdk.Configuration.create_with_component_type(mavsdk.ComponentType.GROUND_STATION)
    with mavsdk.Mavsdk(role) as client:
        client.add_any_connection(served.url.replace("udp://", "udpout://"))
        system = client.first_autopilot(PATIENCE_S)
        assert system is not None
        seen = telemetry.Telemetry(system)
        until(lambda: seen.battery().voltage_v > 12.0)
        assert not seen.armed()
        link.take_control()
        link.command(Command.ARM)
        link.command(Command.TAKE_OFF, 1.0)
        until(lambda: link.state.mission is MissionState.HOLD)
        until(lambda: seen.position_velocity_ned().position.down_m < -0.9)
        assert seen.armed()
        ours, there = link.state, seen.position_velocity_ned().position
        world_m = frames.flip_vector([there.north_m, there.east_m, there.down_m])
        np.testing.assert_allclose(world_m, ours.position_world_m, atol=0.05)
        q = seen.attitude_quaternion()
        assert abs(frames.flip_attitude([q.w, q.x, q.y, q.z]) @ ours.q_world_body) > 0.999
        pose = seen.odometry().position_body
        np.testing.assert_allclose(frames.flip_vector([pose.x_m, pose.y_m, pose.z_m]), ours.position_world_m, atol=0.05)
