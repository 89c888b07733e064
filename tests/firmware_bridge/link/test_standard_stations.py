"""Standard ground stations fly the SITL vehicle: MAVSDK through the signing proxy, pymavlink signed by itself, and the
messages that QGroundControl sends, in its order."""

import contextlib
import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from firmware_bridge.dialect.generated.messages import LinkReason
from firmware_bridge.proxy import Proxy
from tests.waiting import PATIENCE_S, until

mavsdk = pytest.importorskip("mavsdk", reason="MAVSDK is a development dependency")
telemetry = pytest.importorskip("mavsdk.plugins.telemetry", reason="this needs MAVSDK 4, which runs without a server")
pytest.importorskip("pymavlink", reason="pymavlink is a development dependency")
action = pytest.importorskip("mavsdk.plugins.action")
param = pytest.importorskip("mavsdk.plugins.param")

NAN = math.nan
ARM, TAKE_OFF, SET_MODE, REPOSITION, REQUEST, CONTROL, METADATA = 400, 22, 176, 192, 512, 32100, 397
ACCEPTED, REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3


@contextlib.contextmanager
def mavsdk_through(proxy: Proxy) -> Iterator[Any]:
    role = mavsdk.Configuration.create_with_component_type(mavsdk.ComponentType.GROUND_STATION)
    with mavsdk.Mavsdk(role) as client:
        client.add_any_connection(proxy.url.replace("udp://", "udpout://"))
        system = client.first_autopilot(PATIENCE_S)
        assert system is not None
        yield system


def test_mavsdk_arms_takes_off_holds_lands_and_disarms(serve, plans):
    served = serve(speed=2.0)
    with Proxy(served.url, plans.key, listen="127.0.0.1:0", control=True) as proxy, mavsdk_through(proxy) as system:
        seen, pilot = telemetry.Telemetry(system), action.Action(system)
        until(lambda: proxy.status.in_control)
        until(lambda: seen.health().is_armable and seen.health().is_local_position_ok)
        assert seen.landed_state() == telemetry.LandedState.ON_GROUND
        pilot.arm()
        until(seen.armed)
        pilot.takeoff()
        until(lambda: seen.flight_mode() == telemetry.FlightMode.TAKEOFF)
        until(lambda: seen.landed_state() == telemetry.LandedState.IN_AIR)
        until(lambda: seen.flight_mode() == telemetry.FlightMode.HOLD)
        assert seen.position_velocity_ned().position.down_m == pytest.approx(-1.5, abs=0.1)
        assert seen.altitude().altitude_relative_m == pytest.approx(1.5, abs=0.1)
        with pytest.raises(action.ActionError, match="DENIED"):
            pilot.disarm()  # not in the air
        pilot.land()
        until(lambda: seen.flight_mode() == telemetry.FlightMode.LAND)
        pilot.hold()
        until(lambda: seen.flight_mode() == telemetry.FlightMode.HOLD)
        assert seen.in_air()
        pilot.land()
        until(lambda: not seen.armed())
        until(lambda: seen.landed_state() == telemetry.LandedState.ON_GROUND)
        pilot.arm()
        until(seen.armed)
        pilot.disarm()
        until(lambda: not seen.armed())


def test_mavsdk_only_reads_through_a_proxy_without_control(serve, plans):
    served = serve()
    with Proxy(served.url, plans.key, listen="127.0.0.1:0") as proxy, mavsdk_through(proxy) as system:
        seen, pilot = telemetry.Telemetry(system), action.Action(system)
        until(lambda: seen.health().is_armable)
        with pytest.raises(action.ActionError):
            pilot.arm()
        assert not seen.armed()


def test_mavsdk_reads_and_sets_parameters_and_a_refused_one_stays(serve, plans, dial):
    served = serve()
    watcher = dial(served, system_id=5)
    with Proxy(served.url, plans.key, listen="127.0.0.1:0", control=True) as proxy, mavsdk_through(proxy) as system:
        values = param.Param(system)
        until(lambda: proxy.status.in_control)
        before = watcher.parameters()
        assert values.get_param_float("mass_kg") == pytest.approx(before["mass_kg"])
        values.set_param_float("kp_z_1_s2", 9.5)
        assert values.get_param_float("kp_z_1_s2") == pytest.approx(9.5)
        for name, value in (("mass_kg", -1.0), ("mass_kg", 50.0), ("kp_z_1_s2", NAN)):  # range, hover, finite
            with pytest.raises(param.ParamError):
                values.set_param_float(name, value)
        assert watcher.parameters() == before | {"kp_z_1_s2": 9.5}


class Pymavlink:
    """A station on pymavlink that repeats its heartbeat and answers the vehicle's challenge."""

    def __init__(self, url: str, monkeypatch: pytest.MonkeyPatch, key: bytes | None = None) -> None:
        monkeypatch.setenv("MAVLINK20", "1")
        from pymavlink import mavutil

        self.link = mavutil.mavlink_connection(url.replace("udp://", "udpout:"), source_system=77, dialect="common")
        if key:
            self.link.setup_signing(key, sign_outgoing=True)
        self.key, self.wants_control, self.in_control = key, False, False
        self.last: dict[str, Any] = {}
        self._beat_s = 0.0

    def until(self, holds: Callable[[], object], timeout_s: float = PATIENCE_S) -> None:
        deadline_s = time.monotonic() + timeout_s
        while not holds():
            assert time.monotonic() < deadline_s, "it did not come about"
            if time.monotonic() > self._beat_s:
                self._beat_s = time.monotonic() + 0.3
                self.link.mav.heartbeat_send(6, 8, 0, 0, 4)
                if self.wants_control:
                    self.send(CONTROL, 0, 1)
            message = self.link.recv_match(blocking=True, timeout=0.02)
            if message is None:
                continue
            self.last[message.get_type()] = message
            if message.get_type() == "PING" and message.target_system == 0:
                self.link.mav.ping_send(message.time_usec, message.seq, 1, 1)
            if message.get_type() == "COMMAND_ACK" and message.command == CONTROL:
                self.in_control = message.result == ACCEPTED

    def send(self, command: int, *parameters: float) -> None:
        self.link.mav.command_long_send(1, 1, command, 0, *parameters, *[NAN] * (7 - len(parameters)))

    def command(self, command: int, *parameters: float) -> Any:
        """Send it until it is acknowledged; the acknowledgement."""
        for _ in range(round(PATIENCE_S)):
            self.last.pop("COMMAND_ACK", None)
            self.send(command, *parameters)
            with contextlib.suppress(AssertionError):
                self.until(lambda: getattr(self.last.get("COMMAND_ACK"), "command", 0) == command, 1.0)
                return self.last["COMMAND_ACK"]
        raise AssertionError(f"command {command} was not acknowledged")

    def mode(self) -> tuple[int, int]:
        """PX4's main and sub mode of the last heartbeat, (0, 0) before the first one."""
        shown = getattr(self.last.get("HEARTBEAT"), "custom_mode", 0)
        return shown >> 16 & 255, shown >> 24

    def armed(self) -> bool:
        return bool(getattr(self.last.get("HEARTBEAT"), "base_mode", 0) & 128)

    def landed_state(self) -> int:
        return getattr(self.last.get("EXTENDED_SYS_STATE"), "landed_state", 0)


def test_pymavlink_signs_takes_control_and_flies_without_a_proxy(serve, plans, monkeypatch):
    served = serve(speed=2.0)
    station = Pymavlink(served.url, monkeypatch, plans.key)
    try:
        station.until(lambda: "SYS_STATUS" in station.last)
        refused = station.command(ARM, 1)
        assert (refused.result, refused.result_param2) == (REJECTED, LinkReason.NOT_IN_CONTROL)
        station.wants_control = True
        station.until(lambda: station.in_control)
        station.until(lambda: station.last["SYS_STATUS"].onboard_control_sensors_health & 1 << 28)
        assert station.command(ARM, 1).result == ACCEPTED
        assert station.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 1.2).result == ACCEPTED  # zeros, as most scripts send it
        station.until(lambda: station.mode() == (4, 3))
        station.until(lambda: "LOCAL_POSITION_NED" in station.last)
        station.until(lambda: abs(station.last["LOCAL_POSITION_NED"].z + 1.2) < 0.1)
        station.link.mav.param_set_send(1, 1, b"rotor0_x_m", 0.2, 9)
        station.until(lambda: "PARAM_VALUE" in station.last)
        value = station.last["PARAM_VALUE"]
        assert value.param_id == "rotor0_x_m"
        assert value.param_value != pytest.approx(0.2)  # refused in the air: the old value ...
        station.until(
            lambda: "rotor0_x_m: may change only when disarmed" in station.last["STATUSTEXT"].text
        )  # ... and why
        station.link.mav.set_mode_send(1, 1, 4 << 16 | 6 << 24)  # AUTO.LAND by the older message
        station.until(lambda: station.mode() == (4, 6))
        station.until(lambda: not station.armed())
    finally:
        station.link.close()


def test_qgroundcontrols_connection_and_guided_actions(serve, plans, monkeypatch):
    """What QGroundControl 5 sends, by its sources (InitialConnectStateMachine, PX4FirmwarePlugin), by the proxy."""
    served = serve(speed=2.0)
    with Proxy(served.url, plans.key, listen="127.0.0.1:0", control=True) as proxy:
        station = Pymavlink(proxy.url, monkeypatch)
        try:
            station.until(lambda: "HEARTBEAT" in station.last)
            assert station.last["HEARTBEAT"].autopilot == 12  # PX4: else it offers no buttons
            for message_id, name in ((148, "AUTOPILOT_VERSION"), (300, "UNKNOWN_300")):  # PROTOCOL_VERSION: QGC's
                assert station.command(REQUEST, message_id).result == ACCEPTED
                station.until(lambda name=name: name in station.last)
            assert station.command(REQUEST, METADATA).result == UNSUPPORTED
            for mission_type in (0, 1, 2):
                station.link.mav.mission_request_list_send(1, 1, mission_type)
                station.until(lambda kind=mission_type: _mission_count(station) == (0, kind))
            station.until(lambda: proxy.status.in_control and "ALTITUDE" in station.last)
            # guidedModeTakeoff: height over "sea level"; it arms once that is acknowledged
            height_m = station.last["ALTITUDE"].altitude_amsl + 1.3
            assert station.command(TAKE_OFF, -1, 0, 0, NAN, NAN, NAN, height_m).result == ACCEPTED
            assert station.command(ARM, 1).result == ACCEPTED
            station.until(lambda: station.landed_state() == 2)
            assert station.last["ALTITUDE"].altitude_relative == pytest.approx(1.3, abs=0.15)
            # guidedModeLand sets a mode and looks whether the heartbeat shows it; pauseVehicle repositions to nowhere
            assert station.command(SET_MODE, 1, 4, 6).result == ACCEPTED
            station.until(lambda: station.mode() == (4, 6))
            assert station.command(REPOSITION, -1, 1, 0, NAN, NAN, NAN, NAN).result == ACCEPTED
            station.until(lambda: station.mode() == (4, 3))
            assert station.command(SET_MODE, 1, 4, 5).result == UNSUPPORTED  # Return: there is no way back
            assert station.command(ARM, 0).result == DENIED
            assert station.command(SET_MODE, 1, 4, 6).result == ACCEPTED
            station.until(lambda: not station.armed() and station.landed_state() == 1)
        finally:
            station.link.close()


def _mission_count(station: Pymavlink) -> tuple[int, int] | None:
    count = station.last.get("MISSION_COUNT")
    return (count.count, count.mission_type) if count else None
