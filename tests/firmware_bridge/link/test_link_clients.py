"""A public client library finds the vehicle and reads its pose; our frames and pymavlink's are the same bytes."""

import time

import numpy as np
import pytest

from firmware_bridge import _controller
from firmware_bridge.dialect.generated import messages as m
from firmware_bridge.mavlink import Codec, Signing
from flight import frames
from tests import waiting

pymavlink = pytest.importorskip("pymavlink", reason="pymavlink is a development dependency")


@pytest.fixture
def mavlink2(monkeypatch):
    monkeypatch.setenv("MAVLINK20", "1")
    from pymavlink import mavutil
    from pymavlink.dialects.v20 import common

    return mavutil, common


def test_pymavlink_finds_the_vehicle_and_reads_its_pose(serve, dial, plans, mavlink2):
    mavutil, common = mavlink2
    served = serve(speed=2.0)
    link = dial(served)
    link.upload(plans.file(1))
    client = mavutil.mavlink_connection(served.url.replace("udp://", "udpout:"), source_system=77, dialect="common")
    try:
        client.mav.heartbeat_send(6, 8, 0, 0, 4)
        heartbeat = client.recv_match(type="HEARTBEAT", blocking=True, timeout=waiting.PATIENCE_S)
        assert heartbeat.type == common.MAV_TYPE_QUADROTOR
        assert heartbeat.get_srcSystem() == 1
        link.take_control()
        link.command(m.Command.ARM)
        link.command(m.Command.TAKE_OFF, 1.0)
        waiting.until(lambda: link.state.mission is m.MissionState.HOLD)
        time.sleep(0.3)  # until it hangs still
        while client.recv_match(blocking=False) is not None:
            pass
        position = client.recv_match(type="LOCAL_POSITION_NED", blocking=True, timeout=waiting.PATIENCE_S)
        attitude = client.recv_match(type="ATTITUDE_QUATERNION", blocking=True, timeout=waiting.PATIENCE_S)
        battery = client.recv_match(type="BATTERY_STATUS", blocking=True, timeout=waiting.PATIENCE_S)
        ours = link.state
        world = frames.flip_vector([position.x, position.y, position.z])
        np.testing.assert_allclose(world, ours.position_world_m, atol=0.05)
        assert world[2] > 0.8
        q = frames.flip_attitude([attitude.q1, attitude.q2, attitude.q3, attitude.q4])
        assert abs(q @ ours.q_world_body) > 0.999
        assert 12_000 < battery.voltages[0] < 17_000
        odometry = client.recv_match(type="ODOMETRY", blocking=True, timeout=waiting.PATIENCE_S)
        np.testing.assert_allclose(
            frames.flip_vector([odometry.x, odometry.y, odometry.z]), ours.position_world_m, atol=0.05
        )
        assert abs(frames.flip_attitude(odometry.q) @ ours.q_world_body) > 0.999
        assert (odometry.frame_id, odometry.child_frame_id) == (20, common.MAV_FRAME_BODY_FRD)
        assert np.isnan(odometry.pose_covariance[0])
        home = client.recv_match(type="HOME_POSITION", blocking=True, timeout=waiting.PATIENCE_S)
        assert abs(home.z) < 0.05  # where it took off, not where it hovers
    finally:
        client.close()


def test_odometry_reports_velocity_in_body_axes():
    """At a quarter turn to the left, flying along world x is flying to the right."""
    table = np.array([row[3] for row in _controller.parameter_table()], dtype=np.float32)
    endpoint = _controller.Controller()
    assert endpoint.set_parameters(table)[0] == 0
    link = _controller.Link(endpoint, None, 1, 0, 1, 10**9, 0, 5000, 1)
    left = [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
    state = np.array([1.0, 2.0, 3.0, 4.0, 0.0, 0.0, *left, 0.1, 0.2, 0.3])
    reader, sent = Codec(9, 1, None), []
    for time_us in range(100_000, 400_000, 10_000):
        endpoint.tick(time_us, state, time_us, time_us, 0.0)
        link.update(time_us)
        while frame := link.transmit(time_us):
            sent += [received.message for received in reader.decode(frame)]
    odometry = next(message for message in sent if isinstance(message, m.Odometry))
    np.testing.assert_allclose([odometry.vx, odometry.vy, odometry.vz], [0.0, 4.0, 0.0], atol=1e-5)
    np.testing.assert_allclose([odometry.x, odometry.y, odometry.z], [1.0, -2.0, -3.0], atol=1e-5)
    np.testing.assert_allclose([odometry.rollspeed, odometry.pitchspeed, odometry.yawspeed], [0.1, -0.2, -0.3])
    assert sum(isinstance(message, m.Odometry) for message in sent) == 3  # half as often as the position
    home = next(message for message in sent if isinstance(message, m.HomePosition))
    np.testing.assert_allclose([home.x, home.y, home.z, *home.q], [1.0, -2.0, -3.0, 1.0, 0.0, 0.0, 0.0])


def test_ned_and_frd_are_the_flips_of_flight_frames(serve, dial):
    link = dial(serve())
    with link._port.inbox(m.LocalPositionNed, m.AttitudeQuaternion, m.State) as inbox:
        seen = [inbox.get(timeout=waiting.PATIENCE_S) for _ in range(10)]
    state = next(s for s in seen if isinstance(s, m.State))
    position = next(s for s in seen if isinstance(s, m.LocalPositionNed))
    attitude = next(s for s in seen if isinstance(s, m.AttitudeQuaternion))
    np.testing.assert_allclose(
        frames.flip_vector([position.x, position.y, position.z]), state.position_world_m, atol=1e-3
    )
    q = [attitude.q1, attitude.q2, attitude.q3, attitude.q4]
    np.testing.assert_allclose(frames.flip_attitude(q), state.q_world_body, atol=1e-3)


def _theirs(common, key: bytes):
    mav = common.MAVLink(None, srcSystem=42, srcComponent=190)
    mav.signing.secret_key = key
    mav.signing.sign_outgoing = True
    mav.signing.timestamp = 10**12
    mav.signing.link_id = 3
    return mav


def test_pymavlink_accepts_our_signature_and_we_accept_its(mavlink2, plans):
    _, common = mavlink2
    theirs = _theirs(common, plans.key)
    ours = Codec(7, 1, Signing(plans.key))
    frame = ours.encode(m.LocalPositionNed(time_boot_ms=5, x=1.5, vz=-2.0))
    parsed = theirs.parse_buffer(frame)
    assert [(p.get_type(), p.x, p.vz, p.get_signed()) for p in parsed] == [("LOCAL_POSITION_NED", 1.5, -2.0, True)]
    packed = common.MAVLink_timesync_message(0, 123456789).pack(theirs)
    received = ours.decode(bytes(packed))
    assert received[0].message == m.Timesync(tc1=0, ts1=123456789)
    assert received[0].system_id == 42
    assert not ours.decode(bytes(packed))  # a replay
    stranger = Codec(7, 1, Signing(b"x" * 32))
    assert not stranger.decode(common.MAVLink_timesync_message(0, 1).pack(theirs))
    assert stranger.counts.refused == 1


def test_a_station_that_only_knows_pymavlink_signs_its_way_in(serve, plans, mavlink2):
    """Ask for the version with the key, over the wire, with nothing of ours."""
    mavutil, common = mavlink2
    served = serve()
    client = mavutil.mavlink_connection(served.url.replace("udp://", "udpout:"), source_system=77, dialect="common")
    try:
        client.setup_signing(plans.key, sign_outgoing=True)
        client.mav.heartbeat_send(6, 8, 0, 0, 4)
        challenge = client.recv_match(
            type="PING", blocking=True, timeout=waiting.PATIENCE_S
        )  # QGroundControl, MAVSDK answer by themselves
        assert (challenge.target_system, challenge.target_component) == (0, 0)
        client.mav.ping_send(challenge.time_usec, challenge.seq, 1, 1)
        client.mav.command_long_send(1, 1, common.MAV_CMD_REQUEST_MESSAGE, 0, 148, 0, 0, 0, 0, 0, 0)
        acknowledged = client.recv_match(type="COMMAND_ACK", blocking=True, timeout=waiting.PATIENCE_S)
        assert (acknowledged.command, acknowledged.result) == (512, 0)
        client.mav.param_request_list_send(1, 1)
        value = client.recv_match(type="PARAM_VALUE", blocking=True, timeout=waiting.PATIENCE_S)
        assert value.param_id == "mass_kg"
    finally:
        client.close()
