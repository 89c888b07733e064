"""What the user of each journey has before the first command: files in an empty folder."""

import shutil
import struct
from pathlib import Path

import cv2
import numpy as np

import vehicle
from flight import FlightLog, frames
from mapping import rendered_room, rendered_world
from mapping.rig import forward_camera
from tests.goshawk import foreign_log
from vehicle import draft
from vehicle.draft import Known

PX4_ORDER = (3, 1, 0, 2)
"""Which of our rotors (front left, going round) are PX4's motors 1 to 4 (front right, rear left, ...)."""
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


def with_ulog(folder: Path) -> FlightLog:
    """A PX4 log of a simulated flight: NED and FRD, microseconds, motors in PX4's order, CA_ROTOR parameters."""
    log = foreign_log.simulated(truth())
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
    hubs, spin = truth().hub_body_m[list(PX4_ORDER)], truth().spin[list(PX4_ORDER)]
    found: dict[str, float | int] = {"CA_ROTOR_COUNT": 4}
    for i in range(4):
        found |= {f"CA_ROTOR{i}_PX": float(hubs[i, 0]), f"CA_ROTOR{i}_PY": float(-hubs[i, 1])}
        found[f"CA_ROTOR{i}_KM"] = float(0.05 * spin[i])
    return found


def _message(kind: bytes, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), kind[0]) + body
