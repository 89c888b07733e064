"""A small good recording of every format, and damaged copies of it."""

from pathlib import Path

import numpy as np

from flight import FlightLog, rotations
from flight.flight_log import from_vectors
from tests.sysid.logs.readers import (
    encode_blackbox,
    encode_dataflash,
    test_crazyflie,
    test_read_blackbox,
    test_read_poses,
    test_read_tlog,
)
from tests.sysid.logs.readers.test_read_bag import record

RENAMED = (b"x", b"TimeUS", b"time", b"motor[0]", b"", b"\xff\xfe", b"ATT", b"1e999", b"nan", b"-1")


def flight() -> FlightLog:
    """A second of smooth motion."""
    time_s = np.linspace(0.0, 0.99, 100)
    wave = np.stack([np.sin(3.0 * time_s + k) for k in range(3)], axis=1)
    vectors = {
        "position_world_m": wave + np.array([0.0, 0.0, 2.0]),
        "velocity_world_m_s": wave,
        "q_world_body": rotations.exp(0.2 * wave),
        "rate_body_rad_s": wave,
        "specific_force_body_m_s2": wave + np.array([0.0, 0.0, 9.8]),
        "rotor_speed_rad_s": 900.0 + 100.0 * np.sin(time_s[:, None] + np.arange(4)),
    }
    return from_vectors(time_s, vectors)


def every(folder: Path) -> dict[str, bytes]:
    """File name to content."""
    test_read_poses.tum(folder / "walk.tum")
    good = {
        "a.BIN": encode_dataflash.encode(flight()),
        "a.BFL": encode_blackbox.header() + encode_blackbox.frames(test_read_blackbox.rows()),
        "a.usd": test_crazyflie.sd_card(),
        "a.tlog": test_read_tlog.encode(),
        "a.tum": (folder / "walk.tum").read_bytes(),
        "a.csv": _csv(),
    }
    for kind in ("bag", "mcap", "db3"):
        place = folder / ("good.bag" if kind == "bag" else f"good_{kind}")
        record(place, kind)
        good[f"a.{kind}"] = (place if kind == "bag" else next(place.glob(f"*.{kind}"))).read_bytes()
    return good


def _csv() -> bytes:
    values = test_crazyflie.VALUES
    rows = [",".join(["Timestamp", *values])]
    rows += [",".join([str(10 * k), *(f"{v[k]:.6g}" for v in values.values())]) for k in range(test_crazyflie.ROWS)]
    return ("\n".join(rows) + "\n").encode()


def mutated(content: bytes, rng: np.random.Generator, *, text: bool) -> bytes:
    """A damaged copy: bytes flipped, cut off, pieces swapped, put in twice or zero; of text, rows and words."""
    kind = int(rng.integers(7 if text else 5))
    data = bytearray(content)
    low, high = np.sort(rng.integers(0, len(data), 2)).tolist()
    if kind == 0:
        for place in rng.integers(0, len(data), rng.integers(1, 40)).tolist():
            data[place] ^= 1 << int(rng.integers(8))
    elif kind == 1:
        del data[int(rng.integers(len(data))) :]
    elif kind == 2:
        middle = (low + high) // 2
        data[low:high] = data[middle:high] + data[low:middle]
    elif kind == 3:
        data[low:low] = data[low : low + min(high - low, 4000)]
    elif kind == 4:
        data[low : low + 200] = bytes(min(200, len(data) - low))
    elif kind == 5:
        lines = data.split(b"\n")
        a, b = rng.integers(0, len(lines), 2).tolist()
        lines[a], lines[b] = lines[b], lines[a]
        data = bytearray(b"\n".join(lines))
    else:
        words = data.split(b",")
        words[int(rng.integers(min(len(words), 30)))] = bytearray(RENAMED[int(rng.integers(len(RENAMED)))])
        data = bytearray(b",".join(words))
    return bytes(data)
