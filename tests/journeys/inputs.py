"""What the user of each journey has before the first command: files in an empty folder."""

import shutil
import struct
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import vehicle
from firmware_bridge.controller import State
from flight import FlightLog, Trajectory, flight_log, frames
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from mapping.camera.rig import forward_camera
from tests.goshawk import foreign_log
from tests.sysid.logs.readers import encode_dataflash
from vehicle import draft, flights, manoeuvres
from vehicle.draft import Known

PX4_ORDER = (3, 1, 0, 2)
"""Which of our rotors (front left, going round) are PX4's motors 1 to 4 (front right, rear left, ...)."""
CRAZYFLIE_ORDER = (1, 2, 3, 0)
"""... and Crazyflie's (front right, rear right, ...)."""
PHOTO_COUNT, PHOTO_SHARE = 40, 0.35
WAYPOINTS = "x_m,y_m,z_m\n0.8,0.8,1.0\n3.0,2.2,1.3\n5.2,3.2,1.2\n"


def truth() -> vehicle.Vehicle:
    """The vehicle that flew: the paper's, as far as a plain model can hold it, pose measured at its centre."""
    flown = vehicle.example()
    for axis in "xyz":
        flown = flown.with_value(f"pose_sensor_{axis}_m", 0.0)
    return flown.without_effect("centre_of_mass")


def with_room(folder: Path, pillar_map: Path) -> None:
    shutil.copytree(pillar_map, folder / "room")
    (folder / "waypoints.csv").write_text(WAYPOINTS)


def with_vehicle(folder: Path) -> None:
    hubs, spin = draft.layout(0.125, "x")
    mass, radius = vehicle.Parameter(0.72, 0.0, "kg", "weighed"), vehicle.Parameter(0.0635, 0.0, "m", "propeller")
    known = Known(mass_kg=mass, hub_body_m=hubs, spin=spin, rotor_radius_m=radius, hover_rad_s=950.0)
    vehicle.commented.write(folder / "quad.toml", draft.draft(known))


def with_foreign_csv(folder: Path) -> FlightLog:
    log = foreign_log.simulated(truth())
    foreign_log.write(folder / "flight.csv", log)
    return log


def with_photographs(folder: Path) -> float:
    """Images of an ordinary lens of 70 degrees without metadata; returns the length of the path in metres."""
    camera = forward_camera("SIMPLE_PINHOLE", 320, 240, [228.5, 160.0, 120.0])
    flown = rendered_world.loop_flight(PHOTO_COUNT, share=PHOTO_SHARE)
    (folder / "photos").mkdir()
    for i, T_world_body in enumerate(flown.T_world_body):
        picture = rendered_world.render(camera, T_world_body, scene=rendered_room.furnished(), seed=i)
        cv2.imwrite(str(folder / "photos" / f"{i:04d}.png"), picture)
    return float(np.linalg.norm(np.diff(flown.T_world_body[:, :3, 3], axis=0), axis=1).sum())


def dragged() -> vehicle.Vehicle:
    """A vehicle of 0.72 kg whose inertias and yaw torque differ from a data sheet's by a sixth, with rotor drag."""
    hubs, spin = draft.layout(0.125, "x")
    mass, radius = vehicle.Parameter(0.72, 0.0, "kg", "weighed"), vehicle.Parameter(0.0635, 0.0, "m", "propeller")
    known = Known(mass_kg=mass, hub_body_m=hubs, spin=spin, rotor_radius_m=radius, hover_rad_s=950.0)
    flown = draft.draft(known)
    for name, factor in (("inertia_xx_kg_m2", 1.2), ("inertia_yy_kg_m2", 0.85), ("inertia_zz_kg_m2", 1.15)):
        flown = flown.with_value(name, factor * flown.value(name))
    return flown.with_effect("rotor_drag_thrust", drag_s_m=0.03)


@cache
def lap() -> FlightLog:
    """Doublets and weaves of that vehicle, 24 s at 100 Hz."""
    return _measured(lap_path(), seed=1)


def lap_path() -> Trajectory:
    """The path of it."""

    def back_and_forth(duration_s: float, size: float, repeats: int = 1) -> list[tuple[float, float]]:
        return [(duration_s, size), (duration_s, -size)] * repeats

    short, still = back_and_forth(0.8, 0.42, 3), [(4.8, 0.0)]
    return manoeuvres.from_legs(
        x=[*short, *still, *back_and_forth(2.5, 8.0, 2), *back_and_forth(2.0, 4.0)],
        y=[*still, *short, *back_and_forth(2.0, 4.0), *back_and_forth(2.5, 8.0, 2)],
        z=[*still, *still, *back_and_forth(1.25, 1.0, 5)],
        yaw=back_and_forth(1.4, 0.8, 8),
    )


@cache
def other_flight() -> FlightLog:
    """A flight of another kind, to judge by."""
    return _measured(manoeuvres.make("oblique"), seed=2)


def _measured(flown: Trajectory, seed: int) -> FlightLog:
    log = flights.measure(flights.fly_trajectory(dragged(), flown), rng=np.random.default_rng(seed))
    return FlightLog({name: values[::2] for name, values in log.columns.items()}, log.metadata)


def with_own_telemetry(folder: Path) -> None:
    """Our own log of a flight, and the file that the vehicle flew with."""
    states = np.full(len(lap()), float(State.TRAJECTORY))
    flight_log.save(folder / "lap.parquet", FlightLog({**lap().columns, "mission_state": states}, lap().metadata))


def with_crazyflie(folder: Path) -> None:
    """A table of Crazyflie's log variables: ms, degrees a second, g, rpm, its motors' order, and their duty cycles."""
    log, order = lap(), list(CRAZYFLIE_ORDER)
    rpm = log.vector("rotor_speed_rad_s")[:, order] * 30.0 / np.pi
    parts = {
        "Timestamp": np.round(1000.0 * (12.0 + log.time_s))[:, None],
        "stateEstimate.x,stateEstimate.y,stateEstimate.z": log.vector("position_world_m"),
        "stateEstimate.qx,stateEstimate.qy,stateEstimate.qz,stateEstimate.qw": np.roll(
            log.vector("q_world_body"), -1, axis=1
        ),
        "gyro.x,gyro.y,gyro.z": np.rad2deg(log.vector("rate_body_rad_s")),
        "acc.x,acc.y,acc.z": log.vector("specific_force_body_m_s2") / frames.GRAVITY_M_S2,
        "motor.m1,motor.m2,motor.m3,motor.m4": np.round(np.clip(2.6 * rpm, 0.0, 65535.0)),
        "rpm.m1,rpm.m2,rpm.m3,rpm.m4": rpm,
        "pm.vbat": log.columns["battery_v"][:, None],
    }
    rows = np.hstack(list(parts.values()))
    (folder / "flight.csv").write_text(
        "\n".join([",".join(parts), *(",".join(f"{value:.9g}" for value in row) for row in rows)])
    )


def with_dataflash(folder: Path) -> None:
    """An ArduPilot log: NED and FRD, motors in its order."""
    log = lap()
    velocity = np.gradient(log.vector("position_world_m"), log.time_s, axis=0)
    columns = dict(zip(flight_log.COLUMNS["velocity_world_m_s"], velocity.T, strict=True))
    (folder / "flight.bin").write_bytes(encode_dataflash.encode(FlightLog({**log.columns, **columns}, log.metadata)))


def with_recording(folder: Path) -> None:
    """A ROS 2 recording: the pose of motion capture and a set-point, IMU, rotor speeds in rpm, battery."""
    store, log = get_typestore(Stores.ROS2_HUMBLE), lap()

    def made(name: str, **fields: Any) -> Any:
        return store.types[name](**fields)

    def triple(values: np.ndarray, name: str = "geometry_msgs/msg/Vector3") -> Any:
        return made(name, x=float(values[0]), y=float(values[1]), z=float(values[2]))

    def pose(header: Any, position: np.ndarray, q: np.ndarray) -> Any:
        turned = made("geometry_msgs/msg/Quaternion", w=float(q[0]), x=float(q[1]), y=float(q[2]), z=float(q[3]))
        at = made("geometry_msgs/msg/Pose", position=triple(position, "geometry_msgs/msg/Point"), orientation=turned)
        return made("geometry_msgs/msg/PoseStamped", header=header, pose=at)

    def imu(header: Any, rate: np.ndarray, force: np.ndarray) -> Any:
        nothing, level = np.zeros(9), made("geometry_msgs/msg/Quaternion", w=1.0, x=0.0, y=0.0, z=0.0)
        return made(
            "sensor_msgs/msg/Imu", header=header, orientation=level, orientation_covariance=nothing,
            angular_velocity=triple(rate), angular_velocity_covariance=nothing,
            linear_acceleration=triple(force), linear_acceleration_covariance=nothing,
        )  # fmt: skip

    layout = made("std_msgs/msg/MultiArrayLayout", dim=[], data_offset=0)
    quantities = ("position_world_m", "q_world_body", "rate_body_rad_s", "specific_force_body_m_s2")
    position, q, rate, force = (log.vector(name) for name in quantities)
    rpm = log.vector("rotor_speed_rad_s") * 30.0 / np.pi
    with Writer(folder / "flight_bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {
            "/goal_pose": "geometry_msgs/msg/PoseStamped",
            "/mocap/quad/pose": "geometry_msgs/msg/PoseStamped",
            "/imu/data": "sensor_msgs/msg/Imu",
            "/motor_speeds": "std_msgs/msg/Float64MultiArray",
            "/battery_voltage": "std_msgs/msg/Float64",
        }
        lines = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in topics.items()}
        for i, time_s in enumerate(log.time_s):
            t = 1_700_000_000_000_000_000 + round(1e9 * time_s)
            stamp = made("builtin_interfaces/msg/Time", sec=t // 10**9, nanosec=t % 10**9)
            header = made("std_msgs/msg/Header", stamp=stamp, frame_id="world")
            messages = {
                "/goal_pose": pose(header, position[i].round(), np.array([1.0, 0.0, 0.0, 0.0])),
                "/mocap/quad/pose": pose(header, position[i], q[i]),
                "/imu/data": imu(header, rate[i], force[i]),
                "/motor_speeds": made("std_msgs/msg/Float64MultiArray", layout=layout, data=rpm[i]),
                "/battery_voltage": made("std_msgs/msg/Float64", data=float(log.columns["battery_v"][i])),
            }
            for topic, message in messages.items():
                writer.write(lines[topic], t, store.serialize_cdr(message, topics[topic]))


def with_ulog(folder: Path) -> FlightLog:
    """A PX4 log of a simulated flight: NED and FRD, microseconds, motors in PX4's order, CA_ROTOR parameters."""
    log = lap()
    stamps = np.round(1e6 * (1.0 + log.time_s)).astype(int).tolist()
    position = frames.flip_vector(log.vector("position_world_m"))
    velocity = frames.flip_vector(np.gradient(log.vector("position_world_m"), log.time_s, axis=0))
    rpm = log.vector("rotor_speed_rad_s")[:, PX4_ORDER] * 30.0 / np.pi
    topics = {
        "vehicle_local_position": (
            "float x;float y;float z;float vx;float vy;float vz;",
            np.hstack([position, velocity]),
        ),
        "vehicle_attitude": ("float[4] q;", frames.flip_attitude(log.vector("q_world_body"))),
        "vehicle_angular_velocity": ("float[3] xyz;", frames.flip_vector(log.vector("rate_body_rad_s"))),
        "esc_status": ("esc_report[4] esc;", rpm),
    }
    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + _message(b"B", bytes(40))
    data += _message(b"F", b"esc_report:float esc_rpm;")
    for name, (fields, _) in topics.items():
        data += _message(b"F", f"{name}:uint64_t timestamp;{fields}".encode())
    for name, value in _px4_parameters().items():
        key = f"{'int32_t' if isinstance(value, int) else 'float'} {name}".encode()
        packed = struct.pack("<i" if isinstance(value, int) else "<f", value)
        data += _message(b"P", struct.pack("<B", len(key)) + key + packed)
    rows = []
    for i, (name, (_, values)) in enumerate(topics.items()):
        data += _message(b"A", struct.pack("<BH", 0, i) + name.encode())
        rows += [(stamp, i, row) for stamp, row in zip(stamps, values.tolist(), strict=True)]
    body = (_message(b"D", struct.pack("<HQ", i, t) + struct.pack(f"<{len(r)}f", *r)) for t, i, r in sorted(rows))
    (folder / "flight.ulg").write_bytes(data + b"".join(body))
    return log


def _px4_parameters() -> dict[str, float | int]:
    hubs, spin = dragged().hub_body_m[list(PX4_ORDER)], dragged().spin[list(PX4_ORDER)]
    found: dict[str, float | int] = {"CA_ROTOR_COUNT": 4}
    for i in range(4):
        found |= {f"CA_ROTOR{i}_PX": float(hubs[i, 0]), f"CA_ROTOR{i}_PY": float(-hubs[i, 1])}
        found[f"CA_ROTOR{i}_KM"] = float(0.05 * spin[i])
    return found


def _message(kind: bytes, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), kind[0]) + body
