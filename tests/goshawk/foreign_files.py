"""Files as strangers bring them: one good set, and every way we know of spoiling it."""

import json
import shutil
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pyarrow as pa
from pyarrow import parquet

import vehicle
from flight import FlightLog, flight_log, project
from goshawk.rendered import world as rendered_world
from mapping.camera import rig
from vehicle import flights, manoeuvres

ROTORS = [f"rotor_speed_{i}_rad_s" for i in range(4)]
POSITION = [f"position_world_{a}_m" for a in "xyz"]
GYRO = [f"rate_body_{a}_rad_s" for a in "xyz"]


def make(folder: Path, map_folder: Path) -> None:
    """Fill a folder with good files and bad ones."""
    _good(folder, map_folder)
    log = flight_log.load(folder / "good.parquet")
    _logs(folder, log)
    _tables(folder, log)
    _vehicles(folder)
    _plans(folder)
    _maps(folder)
    _images(folder)
    _others(folder)


def _good(folder: Path, map_folder: Path) -> None:
    shutil.copytree(map_folder, folder / "map")
    vehicle.save(folder / "vehicle.toml", vehicle.example())
    truth = flights.fly_trajectory(vehicle.example(), manoeuvres.make("doublets"))
    log = flights.measure(truth, rng=np.random.default_rng(0))
    log = log.slice(float(log.time_s[0]), float(log.time_s[0]) + 4.0)
    flight_log.save(folder / "good.parquet", log)
    points = np.array([[0.8, 0.8, 1.2], [3.0, 2.6, 1.2], [5.2, 1.0, 1.2]])
    project.save_waypoints(folder / "waypoints.json", project.Waypoints(points, np.full(3, np.nan)))


def _logs(folder: Path, log: FlightLog) -> None:
    good = (folder / "good.parquet").read_bytes()

    def changed(name: str, **columns: np.ndarray) -> None:
        flight_log.save(folder / name, FlightLog({**log.columns, **columns}, log.metadata))

    nan = np.full(len(log), np.nan)
    changed("nan_position.parquet", **{POSITION[0]: nan})
    changed("nan_gyro.parquet", **dict.fromkeys(GYRO, nan))
    changed("nan_one_gyro.parquet", **{GYRO[1]: nan})
    changed("nan_rotor.parquet", **{ROTORS[2]: nan})
    changed("nan_everything.parquet", **{name: nan for name in log.columns if name != "time_s"})
    changed("nan_force.parquet", **{f"specific_force_body_{a}_m_s2": nan for a in "xyz"})
    changed("nan_battery.parquet", battery_v=nan)
    changed("nan_velocity.parquet", **{f"velocity_world_{a}_m_s": nan for a in "xyz"})
    changed("inf_position.parquet", **{POSITION[2]: np.where(np.arange(len(log)) == 7, np.inf, 1.0)})
    changed("far_position.parquet", **dict.fromkeys(POSITION, np.full(len(log), 1e300)))
    changed("zero_attitude.parquet", **{f"q_world_body_{i}": 0.0 * nan + 0.0 for i in "wxyz"})
    changed("still.parquet", **{n: np.full(len(log), v[0]) for n, v in log.columns.items() if n != "time_s"})
    changed("stopped_rotors.parquet", **dict.fromkeys(ROTORS, np.zeros(len(log))))
    changed("rpm.parquet", **{n: log.columns[n] * 60.0 / (2.0 * np.pi) for n in ROTORS})
    changed("hz.parquet", **{n: log.columns[n] / (60.0 / (2.0 * np.pi)) for n in ROTORS})
    changed("milliseconds.parquet", time_s=1e3 * log.time_s)
    changed("nanoseconds.parquet", time_s=1e9 * log.time_s)
    changed("no_air.parquet", mission_state=np.zeros(len(log)))
    changed("odd_state.parquet", mission_state=nan)
    for name, rows in (("no_rows", 0), ("one_row", 1), ("two_rows", 2), ("short", 40)):
        short = FlightLog({n: v[:rows] for n, v in log.columns.items()}, log.metadata)
        flight_log.save(folder / f"{name}.parquet", short)
    only = {n: v for n, v in log.columns.items() if n == "time_s"}
    flight_log.save(folder / "only_time.parquet", FlightLog(only, {}))
    flight_log.save(folder / "odd_mark.parquet", FlightLog(log.columns, {"payload_carried": "yes", "name": 7}))
    (folder / "empty.parquet").write_bytes(b"")
    (folder / "cut.parquet").write_bytes(good[: len(good) // 2])
    (folder / "tail.parquet").write_bytes(good[len(good) // 2 :])
    (folder / "text.parquet").write_text("time_s,x\n1,2\n")
    (folder / "flipped.parquet").write_bytes(bytes(b ^ (i % 97 == 0) * 255 for i, b in enumerate(good)))
    (folder / "folder.parquet").mkdir()
    table = parquet.read_table(folder / "good.parquet")

    def with_header(name: str, header: object, changed: pa.Table = table) -> None:
        text = json.dumps(header)
        parquet.write_table(changed.replace_schema_metadata({"goshawk": text}), folder / name)

    head = {"format": "goshawk-flight-log", "version": 1, "metadata": {}}
    parquet.write_table(table.replace_schema_metadata({}), folder / "foreign.parquet")
    with_header("newer.parquet", head | {"version": 99})
    with_header("odd_version.parquet", head | {"version": "1"})
    with_header("odd_metadata.parquet", head | {"metadata": [1, 2]})
    with_header("no_metadata.parquet", {k: v for k, v in head.items() if k != "metadata"})
    words = pa.array([["a", "b"][i % 2] for i in range(len(log))])
    with_header("words.parquet", head, table.append_column("note_ratio", words))
    lists = pa.array([[1.0, 2.0]] * len(log))
    with_header("lists.parquet", head, table.append_column("pair_ratio", lists))
    with_header("no_time.parquet", head, table.drop_columns(["time_s"]))
    back = pa.array(log.time_s[::-1].copy())
    with_header("backward.parquet", head, table.set_column(table.column_names.index("time_s"), "time_s", back))
    with_header("no_unit.parquet", head, table.append_column("height", pa.array(log.time_s)))


def _tables(folder: Path, log: FlightLog) -> None:
    """Foreign CSV files and column maps."""
    q = log.vector("q_world_body")
    rows = np.column_stack([log.time_s, log.vector("position_world_m"), q, log.vector("rotor_speed_rad_s")])
    names = ["t", "x", "y", "z", "qw", "qx", "qy", "qz", "n0", "n1", "n2", "n3"]
    text = "\n".join([",".join(names), *(",".join(f"{v:.9g}" for v in row) for row in rows)]) + "\n"
    (folder / "good.csv").write_text(text)
    good = (
        'format = "goshawk-csv-map"\nversion = 1\n[time]\ncolumn = "t"\nunit = "s"\n'
        '[quantity.position_world_m]\ncolumns = ["x", "y", "z"]\nunit = "m"\n'
        '[quantity.q_world_body]\ncolumns = ["qw", "qx", "qy", "qz"]\norder = "w x y z"\n'
        '[quantity.rotor_speed_rad_s]\ncolumns = ["n0", "n1", "n2", "n3"]\nunit = "rad/s"\n'
    )
    lines = text.splitlines()
    csv: dict[str, str | bytes] = {
        "empty": "",
        "header": lines[0] + "\n",
        "ragged": "\n".join([*lines[:50], "1,2,3", *lines[50:]]),
        "latin": text.replace("qw", "q\xe4", 1).encode("latin-1"),
        "semicolon": text.replace(",", ";"),
        "tabs": text.replace(",", "\t"),
        "words": "\n".join([lines[0], *(",".join(["now", *line.split(",")[1:]]) for line in lines[1:])]),
        "nul": text[:500].encode() + b"\0\0\0" + text[500:].encode(),
        "twice": text.replace("qx", "qw", 1),
        "backward": "\n".join([lines[0], *lines[:0:-1]]),
        "nan": "\n".join([lines[0], *(",".join([line.split(",")[0], *["nan"] * 11]) for line in lines[1:])]),
        "long_line": lines[0] + "," * 200_000 + "\n" + lines[1],
        "binary": bytes(range(256)) * 40,
        "utf16": text.encode("utf-16"),
    }
    for name, content in csv.items():
        data = content if isinstance(content, bytes) else content.encode()
        (folder / f"{name}.csv").write_bytes(data)
    (folder / "broken.csv.gz").write_bytes(b"\x1f\x8b\x08\x00hello, this is no gzip file at all")
    (folder / "plain.csv.gz").write_text(text)
    maps = {
        "good": good,
        "no_time": good.replace('[time]\ncolumn = "t"\nunit = "s"\n', ""),
        "time_word": good.replace('[time]\ncolumn = "t"\nunit = "s"\n', 'time = "t"\n'),
        "no_column": good.replace('column = "t"\n', ""),
        "unit": good.replace('unit = "rad/s"', 'unit = "furlongs"'),
        "unit_number": good.replace('unit = "rad/s"', "unit = 9"),
        "unit_list": good.replace('unit = "rad/s"', 'unit = ["rad/s"]'),
        "misspelt": good.replace('unit = "m"', 'units = "cm"'),
        "columns_word": good.replace('columns = ["x", "y", "z"]', 'columns = "x"'),
        "columns_two": good.replace('["x", "y", "z"]', '["x", "y"]'),
        "columns_none": good.replace('["x", "y", "z"]', "[]"),
        "columns_numbers": good.replace('["x", "y", "z"]', "[1, 2, 3]"),
        "q_three": good.replace('["qw", "qx", "qy", "qz"]', '["qw", "qx", "qy"]'),
        "no_order": good.replace('order = "w x y z"\n', ""),
        "order_word": good.replace('order = "w x y z"', 'order = "z y x"'),
        "order_list": good.replace('order = "w x y z"', "order = [0, 1, 2, 3]"),
        "frame": good.replace('unit = "m"', 'unit = "m"\nframe = "sideways"'),
        "scale_word": good.replace('unit = "m"', 'unit = "m"\nscale = "big"'),
        "scale_nan": good.replace('unit = "m"', 'unit = "m"\nscale = nan'),
        "keep_empty": good + '[keep]\ncolumn = "t"\n',
        "keep_word": good + 'keep = "all"\n'.replace("keep", "keep_"),
        "quantity_list": good + "[[quantity.wind_world_m_s]]\n",
        "quantity_unknown": good + '[quantity.mood]\ncolumns = ["x"]\n',
        "scalar_no_unit": good + '[scalar.height]\ncolumn = "z"\n',
        "scalar_list": good + "scalar = [1]\n".replace("scalar", "scalar_"),
        "metadata_word": good.replace("[time]", 'metadata = "x"\n[time]'),
        "no_such_column": good.replace('"n3"', '"n4"'),
        "version": good.replace("version = 1", "version = 9"),
        "degrees": good.replace('unit = "rad/s"', 'unit = "deg/s"'),
        "rpm": good.replace('unit = "rad/s"', 'unit = "rpm"'),
        "empty": "",
    }
    for name, content in maps.items():
        (folder / f"map_{name}.toml").write_text(content)
    bag = 'format = "goshawk-bag-map"\nversion = 1\n'
    (folder / "bag.toml").write_text(bag + '[pose]\ntopic = "/pose"\n')
    (folder / "bag_word.toml").write_text(bag + 'pose = "/pose"\n')
    (folder / "bag_fields.toml").write_text(bag + '[quantity.rotor_speed_rad_s]\ntopic = 7\nfields = "data"\n')
    for name in ("garbage.ulg", "garbage.mcap", "garbage.bag", "garbage.db3"):
        (folder / name).write_bytes(b"not what the name says " * 20)
    (folder / "empty.ulg").write_bytes(b"")
    (folder / "header.ulg").write_bytes(b"ULog\x01\x12\x35\x01" + bytes(8))
    (folder / "rosbag").mkdir()
    (folder / "rosbag" / "metadata.yaml").write_text("rosbag2_bagfile_information: [1, 2\n")


def _vehicles(folder: Path) -> None:
    good = (folder / "vehicle.toml").read_text()
    mass = next(line for line in good.splitlines() if line.startswith("value")) if "[body.mass_kg]" in good else ""
    assert mass, "the writer's layout of a vehicle file has changed: spoil it another way"
    first = good.index("[body.mass_kg]")

    def in_mass(old: str, new: str) -> str:
        head, tail = good[:first], good[first:]
        assert old in tail
        return head + tail.replace(old, new, 1)

    vehicles = {
        "number": in_mass(tail_of(good, "[body.mass_kg]"), "[body]\nmass_kg = 0.7\n\n"),
        "no_unit": in_mass('unit = "kg"\n', ""),
        "wrong_unit": in_mass('unit = "kg"', 'unit = "g"'),
        "unit_number": in_mass('unit = "kg"', "unit = 1"),
        "no_value": in_mass(mass + "\n", ""),
        "value_word": in_mass(mass, 'value = "0.7"'),
        "value_nan": in_mass(mass, "value = nan"),
        "value_inf": in_mass(mass, "value = inf"),
        "value_true": in_mass(mass, "value = true"),
        "value_list": in_mass(mass, "value = [0.7]"),
        "negative": in_mass(mass, "value = -0.7"),
        "zero": in_mass(mass, "value = 0.0"),
        "surplus_key": in_mass(mass, mass + "\nmaximum = 2"),
        "std_negative": in_mass("std = ", "std = -1 #"),
        "std_word": in_mass("std = ", 'std = "x" #'),
        "no_mass": in_mass(tail_of(good, "[body.mass_kg]"), ""),
        "no_name": good.replace('name = "rigter2019"\n', ""),
        "effects_word": good.replace("effects = [", 'effects = "thrust_bem"\nother = [', 1),
        "effects_numbers": good.replace("effects = [", "effects = [1, 2]\nother = [", 1),
        "effect_unknown": good.replace('"motor_lag"', '"motor_leg"'),
        "effect_word": good + '\n[effect]\nmotor_lag2 = "fast"\n'.replace("[effect]", "[effect.other]"),
        "effect_file_number": "effect_files = [3]\n".join(good.split("effect_files = []\n")),
        "effect_file_missing": 'effect_files = ["none.py"]\n'.join(good.split("effect_files = []\n")),
        "effect_file_raises": 'effect_files = ["raises.py"]\n'.join(good.split("effect_files = []\n")),
        "no_rotors": good.replace("[rotors]", "[motors]"),
        "spin_zero": good.replace("[rotors]", "[rotors]\nextra = 1").replace("spin = [\n    -1", "spin = [\n    0", 1),
        "limits_word": good.replace("speed_m_s = ", 'speed_m_s = "fast" #', 1),
        "limits_unknown": good.replace("speed_m_s = ", "pace_m_s = ", 1),
        "version_float": good.replace("version = 1", "version = 1.5"),
        "version_newer": good.replace("version = 1", "version = 99"),
        "twice": good + "\n[rotors]\n",
        "cut": good[: len(good) // 2],
        "empty": "",
        "json": '{"format": "goshawk-vehicle", "version": 1}',
        "bare": 'format = "goshawk-vehicle"\nversion = 1\n',
        "body_list": 'format = "goshawk-vehicle"\nversion = 1\nname = "x"\neffects = []\nbody = [1]\n',
        "other_format": good.replace("goshawk-vehicle", "goshawk-map"),
    }
    for name, text in vehicles.items():
        (folder / f"v_{name}.toml").write_text(text)
    (folder / "v_binary.toml").write_bytes(bytes(range(256)))
    (folder / "raises.py").write_text("raise RuntimeError('boom')\n")
    (folder / "no_effect.py").write_text("EFFECT = 3\n")


def tail_of(text: str, head: str) -> str:
    """From a table's head to the next one's."""
    start = text.index(head)
    return text[start : text.index("\n[", start) + 1]


def _plans(folder: Path) -> None:
    head = {"format": "goshawk-waypoints", "version": 1}

    def points(*positions: object) -> object:
        return head | {"waypoints": [{"position_world_m": p, "yaw_rad": None} for p in positions]}

    ok = [0.8, 0.8, 1.2]
    waypoints: dict[str, object] = {
        "none": points(),
        "one": points(ok),
        "same": points(ok, ok),
        "two_numbers": points(ok[:2], ok[:2]),
        "four_numbers": points([*ok, 1.0], [*ok, 2.0]),
        "words": points(["a", "b", "c"], ok),
        "null": points([None, 1, 2], ok),
        "nested": points([ok], [ok]),
        "huge": points(ok, [1e300, 0, 1]),
        "far": points(ok, [500.0, 0, 1]),
        "in_wall": points(ok, [2.0, 1.5, 1.2]),
        "object": head | {"waypoints": {"a": 1}},
        "no_key": head,
        "yaw_word": head | {"waypoints": [{"position_world_m": ok, "yaw_rad": "north"}] * 2},
        "list": [1, 2],
        "format_list": {"format": ["goshawk-waypoints"], "version": 1},
        "version_true": {"format": "goshawk-waypoints", "version": True, "waypoints": []},
    }
    for name, document in waypoints.items():
        (folder / f"w_{name}.json").write_text(json.dumps(document))
    (folder / "w_nan.json").write_text(json.dumps(points([float("nan"), 1, 1], ok)))
    (folder / "w_deep.json").write_text("[" * 100_000)
    (folder / "w_digits.json").write_text('{"format": "goshawk-waypoints", "version": ' + "9" * 5000 + "}")
    (folder / "w_utf16.json").write_bytes(json.dumps(points(ok, ok)).encode("utf-16"))
    good: dict[str, object] = {
        "format": "goshawk-trajectory", "version": 1, "name": "t", "frame": "world",
        "basis": "ascending powers of seconds from the segment's start", "map_hash": "", "vehicle_hash": "",
        "waypoints_world_m": [[0.8, 0.8, 1.2], [1.8, 0.8, 1.2]], "check": {"passed": True},
        "segments": [{"duration_s": 2.0, "x": [0.8, 0.5], "y": [0.8, 0.0], "z": [1.2, 0.0], "yaw": [0.0, 0.0]}],
    }  # fmt: skip
    one = good["segments"][0]  # type: ignore[index]
    bad: dict[str, object] = {
        "good": good,
        "no_segments": good | {"segments": []},
        "segments_word": good | {"segments": "none"},
        "zero_time": good | {"segments": [one | {"duration_s": 0.0}]},
        "negative_time": good | {"segments": [one | {"duration_s": -1.0}]},
        "time_word": good | {"segments": [one | {"duration_s": "long"}]},
        "no_axis": good | {"segments": [{"duration_s": 1.0, "x": [0.0]}]},
        "ragged": good | {"segments": [one | {"x": [0.8]}]},
        "infinite": good | {"segments": [one | {"x": [1e400, 0.0]}]},
        "check_word": good | {"check": "passed"},
        "waypoints_word": good | {"waypoints_world_m": "here"},
        "hash_number": good | {"map_hash": 7},
        "long": good | {"segments": [one | {"duration_s": 1e9}]},
        "wide": good | {"segments": [one | {"x": [0.0] * 4000, "y": [0.0] * 4000, "z": [0.0] * 4000}]},
    }
    for name, document in bad.items():
        (folder / f"t_{name}.json").write_text(json.dumps(document))
    header = "x_m,y_m,z_m\n"
    paths = {
        "empty": "",
        "header": header,
        "one": header + "1,1,1\n",
        "words": header + "a,b,c\nd,e,f\n",
        "missing": "x_m,y_m\n1,2\n3,4\n",
        "ragged": header + "1,1\n2,2\n",
        "nan": header + "nan,1,1\n1,1,1\n",
        "outside": header + "100,100,1\n101,100,1\n",
    }
    for name, text in paths.items():
        (folder / f"p_{name}.csv").write_text(text)
    (folder / "p_binary.csv").write_bytes(bytes(range(256)))


def _maps(folder: Path) -> None:
    def spoilt(name: str, spoil: Callable[[Path], object]) -> None:
        shutil.copytree(folder / "map", folder / name)
        spoil(folder / name)

    spoilt("map_no_esdf", lambda m: shutil.rmtree(m / "esdf"))
    spoilt("map_cut", lambda m: (m / "esdf/state.npz").write_bytes((m / "esdf/state.npz").read_bytes()[:200]))
    spoilt("map_garbage", lambda m: (m / "map.toml").write_bytes(b"\x00\xff"))
    spoilt("map_no_poses", lambda m: (m / "poses.csv").unlink())
    spoilt("map_bad_poses", lambda m: (m / "poses.csv").write_text("image,time_s\na,b\n"))
    spoilt("map_edits", lambda m: (m / "esdf/edits.json").write_text('{"format": "goshawk-edits", "version": 1}'))
    spoilt("map_camera", lambda m: (m / "camera.toml").write_text("x"))
    text = (folder / "map/esdf/esdf.toml").read_text()
    huge = text.replace("128", "128000000").replace("0.05", "1e-9")
    spoilt("map_huge", lambda m: (m / "esdf/esdf.toml").write_text(huge))
    (folder / "not_a_map").mkdir()
    (folder / "not_a_map" / "thesis.tex").write_text("precious")


def _images(folder: Path) -> None:
    good = rendered_world.default_rig(0.2)
    rig.save(folder / "camera.toml", good)
    text = (folder / "camera.toml").read_text()
    for name, old, new in (
        ("none", "[[camera]]", "[[photograph]]"),
        ("model", 'model = "', 'model = "PERISCOPE_'),
        ("size", "width = ", "width = -"),
        ("size_word", "width = ", 'width = "wide" #'),
        ("size_huge", "width = ", "width = 1000000000 #"),
        ("params", "params = [", "params = [1.0]\nother = ["),
    ):
        (folder / f"c_{name}.toml").write_text(text.replace(old, new))
    picture = np.full((good.cameras[0].height, good.cameras[0].width), 128, np.uint8)
    data = cv2.imencode(".png", picture)[1].tobytes()
    spoilt = {
        "empty": b"", "text": b"P2 this is no picture", "cut": data[: len(data) // 2], "small": None,
        "blank": data, "bomb": png_header(20_000, 20_000), "jpeg_bomb": jpeg_header(20_000, 20_000),
    }  # fmt: skip
    for name, content in spoilt.items():
        if content is None:
            content = cv2.imencode(".png", picture[:20, :20])[1].tobytes()
        for camera in good.cameras:
            where = folder / f"images_{name}" / camera.folder
            where.mkdir(parents=True, exist_ok=True)
            for i in range(3):
                (where / f"{i}.png").write_bytes(content)
    (folder / "no_images").mkdir()


def png_header(width: int, height: int) -> bytes:
    """A PNG that says it is huge, with hardly any data: decoders that believe it take gigabytes."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(bytes(100_000))) + chunk(b"IEND", b"")


def jpeg_header(width: int, height: int) -> bytes:
    data = bytearray(cv2.imencode(".jpg", np.zeros((8, 8), np.uint8))[1].tobytes())
    at = data.index(b"\xff\xc0")
    data[at + 5 : at + 9] = struct.pack(">HH", height, width)
    return bytes(data)


def _others(folder: Path) -> None:
    head = {"schema": "goshawk-diagnosis", "version": 1, "verdict": "nothing"}
    curve = {
        "channel": "M_z", "variable": "v_z", "variable_unit": "m/s", "at": [0.0, 1.0, 2.0, 3.0],
        "residual": [0.0, 1.0, 2.0, 3.0], "residual_sigma": [0.1] * 4, "residual_unit": "rad/s2",
    }  # fmt: skip
    for name, document in {
        "none": head | {"outside": None},
        "word": head | {"outside": "M_z"},
        "empty": head | {"outside": {}},
        "ragged": head | {"outside": curve | {"residual": [1.0]}},
        "words": head | {"outside": curve | {"at": ["a", "b", "c", "d"]}},
        "channel": head | {"outside": curve | {"channel": "Q"}},
        "list": [1],
    }.items():
        (folder / f"d_{name}.json").write_text(json.dumps(document))
    (folder / "d_cut.json").write_text(json.dumps(head)[:20])
    (folder / "existing.json").write_text("precious")
    (folder / "existing.toml").write_text("precious")
    (folder / "existing.parquet").write_text("precious")
    (folder / "existing.csv").write_text("precious")
    (folder / "existing.html").write_text("precious")
    (folder / "existing.py").write_text("precious")
    (folder / "huge_cameras.txt").write_text("1 PINHOLE 99999999999 480 400 400 320 240\n")
    (folder / "nowhere.json").symlink_to(folder / "gone.json")
    (folder / "full.json").symlink_to("/dev/full")
