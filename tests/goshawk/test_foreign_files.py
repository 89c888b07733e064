"""A stranger's files by verb: one sentence that helps, never a traceback, never exit 0 on a wrong answer."""

import json
import os
import resource
import shlex
import subprocess
import sys

import pytest

from tests.goshawk.typing_in import attempt, last_sentence, listing

GIB = 1 << 30
V, M = "--vehicle vehicle.toml", "--map map"
READ = "log check {} --vehicle vehicle.toml"
FIT = "identify {} --vehicle vehicle.toml --out new.toml"
BAD_LOGS = [
    "empty",
    "cut",
    "tail",
    "text",
    "flipped",
    "folder",
    "foreign",
    "newer",
    "odd_version",
    "odd_metadata",
    "words",
    "lists",
    "no_time",
    "backward",
    "no_unit",
    "none",
]
UNUSABLE_LOGS = [
    "nan_position",
    "nan_rotor",
    "nan_everything",
    "inf_position",
    "zero_attitude",
    "no_rows",
    "one_row",
    "two_rows",
    "only_time",
    "odd_mark",
    "no_air",
    "odd_state",
    "milliseconds",
    "nanoseconds",
]
BAD_CSV = [
    "empty",
    "header",
    "ragged",
    "latin",
    "semicolon",
    "tabs",
    "nul",
    "twice",
    "long_line",
    "binary",
    "utf16",
    "none",
    "words",
    "backward",
]
BAD_MAPS = [
    "no_time",
    "time_word",
    "no_column",
    "unit",
    "unit_number",
    "unit_list",
    "misspelt",
    "columns_word",
    "columns_two",
    "columns_none",
    "columns_numbers",
    "q_three",
    "no_order",
    "order_word",
    "order_list",
    "frame",
    "scale_word",
    "scale_nan",
    "keep_empty",
    "keep_word",
    "quantity_list",
    "quantity_unknown",
    "scalar_no_unit",
    "scalar_list",
    "metadata_word",
    "no_such_column",
    "version",
    "empty",
]
BAD_VEHICLES = [
    "number",
    "no_unit",
    "wrong_unit",
    "unit_number",
    "no_value",
    "value_word",
    "value_nan",
    "value_inf",
    "value_true",
    "value_list",
    "negative",
    "zero",
    "surplus_key",
    "std_negative",
    "std_word",
    "no_mass",
    "no_name",
    "effects_word",
    "effects_numbers",
    "effect_unknown",
    "effect_word",
    "effect_file_number",
    "effect_file_missing",
    "effect_file_raises",
    "no_rotors",
    "spin_zero",
    "limits_word",
    "limits_unknown",
    "version_float",
    "version_newer",
    "twice",
    "cut",
    "empty",
    "json",
    "bare",
    "body_list",
    "other_format",
    "binary",
]
BAD_WAYPOINTS = [
    "none",
    "one",
    "two_numbers",
    "four_numbers",
    "words",
    "null",
    "nested",
    "huge",
    "object",
    "no_key",
    "yaw_word",
    "list",
    "format_list",
    "version_true",
    "nan",
    "deep",
    "digits",
    "utf16",
    "missing",
]
BAD_PLANS = (
    "no_segments segments_word zero_time negative_time time_word no_axis ragged infinite check_word waypoints_word long"
)
BAD_FIELDS = "map_no_esdf map_cut map_garbage map_no_poses map_bad_poses map_edits map_camera map_huge not_a_map none"
BAD_IMAGES = "images_empty images_text images_cut images_small images_bomb images_jpeg_bomb no_images none camera.toml"
BAD_CAMERAS = "none model size size_word size_huge params missing"
BAD_DIAGNOSES = "none word empty ragged words channel list cut missing"
PLAN = f"plan waypoints.json {M} {V} --out new.json"
MAP = "map build images_blank --camera camera.toml --out new_map"

REFUSED = [  # (the command, words of the sentence): exit code 2
    *[(READ.format(f"{name}.parquet"), name) for name in BAD_LOGS],
    *[(FIT.format(f"{name}.parquet"), "") for name in (*BAD_LOGS, *UNUSABLE_LOGS)],
    *[(f"{READ.format(f'{name}.csv')} --columns map_good.toml", name) for name in BAD_CSV],
    *[(f"{READ.format(f'{name}.csv.gz')} --columns map_good.toml", name) for name in ("broken", "plain")],
    *[(f"{READ.format('good.csv')} --columns map_{name}.toml", "") for name in BAD_MAPS],
    *[(f"log show garbage.{kind} --columns bag.toml", "garbage") for kind in ("ulg", "mcap", "bag", "db3")],
    *[(f"log show {name} --columns bag.toml", name) for name in ("empty.ulg", "header.ulg", "rosbag")],
    *[(f"log show garbage.mcap --columns {name}.toml", name) for name in ("bag_word", "bag_fields", "map_good")],
    *[(f"vehicle show v_{name}.toml", f"v_{name}.toml") for name in BAD_VEHICLES],
    *[(f"plan w_{name}.json {M} {V} --out new.json", "") for name in BAD_WAYPOINTS],
    *[(f"check t_{name}.json {M} {V}", f"t_{name}") for name in BAD_PLANS.split()],
    *[(f"plan waypoints.json --map {name} {V} --out new.json", name) for name in BAD_FIELDS.split()],
    *[(f"map build {name} --camera camera.toml --out new_map", "") for name in BAD_IMAGES.split()],
    *[(f"map build images_blank --camera c_{name}.toml --out new_map", "c") for name in BAD_CAMERAS.split()],
    *[
        (f"vehicle effect scaffold vehicle.toml --diagnosis d_{name}.json --name mine --out new.py", "")
        for name in BAD_DIAGNOSES.split()
    ],
    *[(f"plan --path p_{n}.csv {M} {V} --out new.json", f"p_{n}") for n in ("empty", "header", "one", "words", "nan")],
    *[(f"plan --path p_{n}.csv {M} {V} --out new.json", "") for n in ("missing", "ragged", "binary", "outside")],
    # options that no machine should believe
    (f"{PLAN} --margin nan", "margin"),
    (f"{PLAN} --margin -1", "margin"),
    (f"{PLAN} --speed nan", "speed"),
    (f"{PLAN} --speed 1e9", "speed"),
    (f"{PLAN} --acceleration 0", "acceleration"),
    *[(f"{PLAN} --jerk {jerk}", f"--jerk {jerk} must be a positive, finite") for jerk in ("0", "-1", "nan", "inf")],
    (f"plan --path p_outside.csv --simplify nan {M} {V} --out new.json", ""),
    (f"{MAP} --voxel 0", "voxel"),
    (f"{MAP} --voxel nan", "voxel"),
    (f"{MAP} --voxel inf", "voxel"),
    (f"{MAP} --voxel 1e-9", "voxel"),
    (f"{MAP} --farthest inf", "farthest"),
    (f"{MAP} --farthest 1e9", "farthest"),
    (f"{MAP} --carrier-radius nan", "carrier-radius"),
    (f"{MAP} --carrier-radius 35", "carrier-radius"),
    (f"{MAP} --carrier-radius 0", "carrier-radius"),
    (f"{MAP} --length nan", "length"),
    (f"{MAP} --length 0", "length"),
    (f"{MAP} --length a,b", "length"),
    (f"{MAP} --length 1e300", "at most 100000 m"),
    (f"{MAP} --references none.csv", "none.csv does not exist"),
    (f"{MAP} --references vehicle.toml", "neither x_m"),
    ("identify good.parquet --vehicle vehicle.toml --out new.toml --prior inertia_xx_kg_m2=nan", "inertia_xx"),
    ("identify good.parquet --vehicle vehicle.toml --out new.toml --prior inertia_xx_kg_m2=-1", "inertia_xx"),
    ("identify good.parquet --vehicle vehicle.toml --out new.toml --steps 0", "step"),
    ("identify good.parquet --vehicle vehicle.toml --out new.toml --add-effect none", "none"),
    ("next-flight good.parquet --vehicle vehicle.toml --space 0,0,0", "volume"),
    ("next-flight good.parquet --vehicle vehicle.toml --space nan,1,1", "space"),
    ("next-flight good.parquet --vehicle vehicle.toml --space 4,4,2 --manoeuvre somersault", "somersault"),
    ("map show-esdf map --out new --slice z=nan", "slice"),
    ("map show-esdf map --out new --slice q=1", "slice"),
    ("map show-esdf map --out new --iso nan", ""),
    ("map show-esdf map --slice z=1", "--out"),
    ("map edit add map --box 1,2", "box"),
    ("map edit add map --box nan,0,0,1,1,1", "box"),
    ("map edit add map --box 900,0,0,901,1,1", "touches no voxel"),
    ("map edit add map --box 1e300,0,0,1e301,1,1", "touches no voxel"),
    ("map edit add map --sphere 0,0,0,-1", ""),
    ("map edit add map", "shape"),
    ("map edit drop map nothing", "nothing"),
    ("map edit undo map", "undo"),
    ("demo --out not_a_map", "not_a_map"),
    ("demo --out new_demo --pairs 0", "pairs"),
    ("sitl --vehicle vehicle.toml --wind nan,0,0 --key new.key", "wind"),
    ("sitl --vehicle vehicle.toml --loss 2 --key new.key", "--loss"),
    ("params get mass_kg --url http://drone --key none.key", "write udp://host:port"),
    ("sitl --vehicle vehicle.toml --delay -1 --key new.key", "delay"),
    ("sitl --vehicle vehicle.toml --delay inf --key new.key", "--delay"),
    ("sitl --vehicle vehicle.toml --wind 1e300,0,0 --key new.key", "at most 100 m/s"),
    ("sitl --vehicle vehicle.toml --rotor 4=.9 --key new.key", "rotor 0 to 3"),
    ("sitl --vehicle vehicle.toml --rotor 2=nan --key new.key", "ratio from 0 to 1.5"),
    ("sitl --vehicle vehicle.toml --gust-std 1e300 --key new.key", "at most 100 m/s"),
    ("sitl --vehicle vehicle.toml --time-factor nan --key new.key", "time-factor"),
    ("sitl --vehicle vehicle.toml --gust-std nan --key new.key", "gust-std"),
    ("sitl --vehicle vehicle.toml --gust-std inf --key new.key", "gust-std"),
    ("sitl --vehicle vehicle.toml --at 1e300,0,0 --key new.key", "--at"),
    ("sitl --vehicle vehicle.toml --start-of t_good.json --ground nan --key new.key", "--ground"),
    ("sitl --vehicle vehicle.toml --seed -1 --key new.key", "--seed"),
    ("vehicle new new.toml --mass 720 --arm 0.125 --prop-diameter 0.127", "faster than sound"),
    ("vehicle new new.toml --mass 0.72 --arm 0.125 --prop-diameter 0.127 --hover-rpm 953", "not rad/s"),
    ("vehicle new new.toml --mass 0.72 --arm 0.125 --prop-diameter 0.127 --hover-rpm 1e300", "--hover-rpm"),
    ("vehicle new new.toml --mass 0.72 --arm 0.125 --prop-diameter 0.127 --hover-rpm 1e-300", "at least 10 rpm"),
    ("vehicle new new.toml --mass 0.72 --arm 0.125 --prop-diameter 127", "--prop-diameter"),
    ("vehicle schema --out /dev/full", "device"),
    (f"{PLAN} --radius nan", "radius"),
    (f"{PLAN} --radius 0.01 --margin 0.01", "reach"),
    ("camera import huge_cameras.txt --out new.toml", "at most 65535"),
    ("camera import vehicle.toml --out new.toml", "is not CAMERA_ID"),
    ("init new_project --name ''", "--name"),
    ("log show words.csv", "words.csv"),
    ("vehicle effect add vehicle.toml rotor_drag_thrust", "rotor_drag_thrust"),
    ("vehicle effect add vehicle.toml raises.py", "boom"),
    ("vehicle effect add vehicle.toml no_effect.py", "no_effect"),
    ("vehicle effect add vehicle.toml flapping_moment --set x=nan", ""),
    ("vehicle effect remove vehicle.toml wings --yes", "wings"),
    ("vehicle undo vehicle.toml --yes", "first version"),
    ("vehicle undo vehicle.toml --to-version 7 --yes", "7"),
    ("vehicle history vehicle.toml --figure new.svg", "FLIGHTS"),
    ("compare good.parquet --vehicle vehicle.toml --vehicle map/../vehicle.toml", "same name"),
    ("compare short.parquet --vehicle vehicle.toml", ""),
    ("diagnose good.parquet good.parquet --vehicle vehicle.toml", "same flight"),
    ("identify good.parquet map/../good.parquet --vehicle vehicle.toml --out new.toml", "same flight"),
    ("identify good.parquet good.parquet --trials 2 --vehicle vehicle.toml --out new.toml", "same flight"),
    ("next-flight good.parquet good.parquet --vehicle vehicle.toml --space 4,4,2", "same flight"),
    ("next-flight good.parquet --vehicle vehicle.toml --space 1e300,1,1", "at most 1000 m"),
    ("diagnose map --vehicle vehicle.toml", "map is a folder"),
    ("diagnose map/mesh.glb --vehicle vehicle.toml", "map/mesh.glb is not a flight log"),
    ("diagnose t_good.json --vehicle vehicle.toml", "t_good.json is not a flight log"),
    ("identify good.parquet --vehicle vehicle.toml --out new.toml --columns none.toml", "none.toml does not exist"),
    ("log mark '' --payload left", "folder"),
    ("log export good.parquet --csv good.parquet --overwrite", "never changed"),
    ("log draft-columns good.csv --out map/../good.csv --overwrite", "never changed"),
    ("localize no_images --map map --out new.csv", ""),
    ("gcs not_a_map", "project"),
    ("gcs good.csv", "good.csv is a file"),
    ("gcs none", "goshawk init none"),
    # results in places where no result belongs
    (FIT.format("good.parquet").replace("new.toml", "existing.toml"), "--overwrite"),
    (FIT.format("good.parquet").replace("new.toml", "vehicle.toml"), "--overwrite"),
    (FIT.format("good.parquet").replace("new.toml", "/dev/full"), "device"),
    (FIT.format("good.parquet").replace("new.toml", "map"), "folder"),
    (FIT.format("good.parquet").replace("new.toml", "vehicle.toml/x.toml"), "not a folder"),
    (f"{FIT.format('good.parquet')} --report existing.html", "--overwrite"),
    (f"{FIT.format('good.parquet')} --plots not_a_map --overwrite", "not a result"),
    (f"{FIT.format('good.parquet')} --report new.toml", "two results"),
    ("diagnose good.parquet --vehicle vehicle.toml --out vehicle.toml", "--overwrite"),
    ("diagnose good.parquet --vehicle vehicle.toml --report existing.html", "--overwrite"),
    ("compare good.parquet --vehicle vehicle.toml --report existing.html", "--overwrite"),
    ("compare good.parquet --vehicle vehicle.toml --plots existing.html", "folder"),
    ("next-flight good.parquet --vehicle vehicle.toml --space 4,4,2 --out existing.json", "--overwrite"),
    (PLAN.replace("new.json", "existing.json"), "--overwrite"),
    (PLAN.replace("new.json", "nowhere.json"), "link"),
    (PLAN.replace("new.json", "full.json --overwrite"), "device"),
    ("fly --out existing.parquet --url udp://127.0.0.1:9", "--overwrite"),
    ("fly --out /dev/full --overwrite --url udp://127.0.0.1:9", "device"),
    ("log download --out existing.parquet --url udp://127.0.0.1:9", "--overwrite"),
    ("localize images_blank --map map --out existing.csv", "--overwrite"),
    (MAP.replace("new_map", "map"), "--overwrite"),
    (MAP.replace("new_map", "not_a_map --overwrite"), "not a result"),
    ("map show-esdf map --out not_a_map --overwrite", "not a result"),
    ("map edit add map --box 1,1,1,2,2,2 --preview existing.html", "--overwrite"),
    ("vehicle effect scaffold vehicle.toml --diagnosis d_empty.json --name mine --out existing.py", ""),
]
WITH_ERRORS = [
    *("nan_position", "nan_rotor", "inf_position", "still", "rpm", "milliseconds", "nanoseconds", "one_row", "no_rows"),
    *("far_position", "zero_attitude", "stopped_rotors"),
]
ANSWERED = [  # (the command, exit code, words): bad news, but news
    *[
        (READ.format(f"{name}.parquet"), int(name in WITH_ERRORS), words)
        for name, words in (
            ("nan_position", "never finite"),
            ("nan_gyro", "never finite"),
            ("nan_one_gyro", "never finite"),
            ("nan_rotor", "never finite"),
            ("nan_force", "never finite"),
            ("nan_velocity", "never finite"),
            ("nan_battery", "never finite"),
            ("nan_everything", "never finite"),
            ("inf_position", "infinite"),
            ("still", "never changes"),
            ("rpm", "rpm"),
            ("milliseconds", "milliseconds"),
            ("nanoseconds", "time looks like"),
            ("one_row", "rows"),
            ("no_rows", "rows"),
            ("only_time", ""),
            ("far_position", ""),
            ("zero_attitude", ""),
            ("stopped_rotors", ""),
        )
    ],
    ("log check nan.csv --columns map_good.toml", 0, "never finite"),
    (f"check t_hash_number.json {M} {V}", 1, "may not be flown"),
    (f"check t_good.json {M} {V} --margin 1e9", 2, "margin"),
    (f"plan w_far.json {M} {V} --out new.json", 2, "outside of the map"),
    (f"plan w_in_wall.json {M} {V} --out new.json", 2, "inside an obstacle"),
    ("log show /dev/null", 2, "/dev/null"),
    ("log show map", 2, "map"),
    ("nonsense", 2, "nonsense"),
    ("", 0, "Project"),
]


@pytest.mark.parametrize(("line", "words"), REFUSED, ids=[line for line, _ in REFUSED])
def test_bad_input_is_refused_in_one_sentence_and_no_file_changes(folder, line, words):
    before = listing(folder)
    code, _, errors = attempt(folder, line)
    assert words in last_sentence(errors)
    assert code == 2, errors
    assert listing(folder) == before


WRITERS = [
    f"init new_project good.parquet {V} {M}",
    "vehicle new new.toml --mass 0.72 --arm 0.125 --prop-diameter 0.127",
    "vehicle schema --out new.json",
    "vehicle effect add vehicle.toml flapping_moment --set moment_kg_m=0.0001",
    "vehicle effect remove vehicle.toml parasitic_drag --yes",
    PLAN,
    "log export good.parquet --csv new.csv",
    "log export good.parquet --mcap new.mcap",
    "log check good.parquet --report new.html",
    f"log fix rpm.parquet {V} --out new.parquet",
    "log import good.parquet --out new.parquet",
    "log draft-columns good.csv --out new.toml",
    f"{FIT.format('good.parquet')} --hold-unidentifiable --anyway",
    "map edit add map --box 1,1,1,2,2,2",
    "map edit add map --box 1,1,1,2,2,2 --preview new.html",
    f"sitl {V} --key new.key",
]


@pytest.mark.parametrize("line", WRITERS)
def test_a_full_disk_is_one_sentence_and_leaves_no_half_file(folder, line):
    """A limit of 0 bytes a file does what a full disk does, to every file that is written."""
    before = listing(folder)
    allowed = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, allowed[1]))
    try:
        code, _, errors = attempt(folder, line)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, allowed)
    assert code == 2, errors
    assert "free some space" in last_sentence(errors)
    assert files(listing(folder)) == files(before)


def files(listed: dict[str, tuple[int, int]]) -> dict[str, int]:
    """Names and sizes; the time of a folder changes with a temporary file."""
    return {name: size for name, (size, _) in listed.items()}


@pytest.mark.parametrize(
    ("full", "line"), [("stdout", "vehicle schema"), ("stdout", f"check t_good.json {M} {V} --json"), ("stderr", "x")]
)
def test_a_full_disk_behind_the_terminals_output_ends_with_exit_code_2_and_no_traceback(folder, full, line):
    with open("/dev/full", "w") as device:
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, full: device}
        ended = subprocess.run([sys.executable, "-m", "goshawk", *shlex.split(line)], cwd=folder, text=True, **streams)
    assert ended.returncode == 2
    if full == "stdout":
        assert "free some space" in last_sentence(ended.stderr)


@pytest.mark.parametrize(("line", "code", "words"), ANSWERED, ids=[line for line, *_ in ANSWERED])
def test_a_fault_is_named(folder, line, code, words):
    before = listing(folder)
    found, out, errors = attempt(folder, line)
    assert found == code, errors
    assert words in out + errors
    if code:
        last_sentence(errors)
    assert listing(folder) == before


def test_json_never_carries_nan(folder):
    for name in ("nan_everything", "inf_position", "far_position", "one_row"):
        code, out, _ = attempt(folder, f"log check {name}.parquet --vehicle vehicle.toml --json")
        assert code in (0, 1)
        json.loads(out, parse_constant=pytest.fail)


def _capped() -> None:
    resource.setrlimit(resource.RLIMIT_DATA, (2 * GIB, 2 * GIB))


@pytest.mark.parametrize(
    "line",
    [
        "map build images_bomb --camera camera.toml --out new_map",
        "map build images_jpeg_bomb --camera camera.toml --out new_map",
        f"plan waypoints.json --map map_huge {V} --out new.json",
        f"check t_wide.json {M} {V}",
        f"plan w_deep.json {M} {V} --out new.json",
        "map edit add map --sphere 0,0,0,1e300 --preview new.png",
    ],
)
@pytest.mark.slow
def test_no_file_takes_more_than_two_gibibytes(folder, line):
    command = [sys.executable, "-m", "goshawk", *shlex.split(line)]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "GOSHAWK_TRACEBACK": ""}
    ended = subprocess.run(
        command,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        preexec_fn=_capped,
        env=environment,
    )
    assert ended.returncode in (0, 1, 2), ended.stderr
    assert "more memory" not in ended.stderr
    if ended.returncode:
        last_sentence(ended.stderr)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "cause"), [("rpm", "rpm"), ("hz", "rpm")])
def test_a_wrong_unit_of_rotor_speed_ends_in_do_not_use(folder, tmp_path, name, cause):
    out = tmp_path / "fitted.toml"
    line = f"identify {name}.parquet --vehicle vehicle.toml --out {out} --hold-unidentifiable"
    code, said, errors = attempt(folder, line)
    assert code == 1, errors
    assert said.startswith("verdict: do not use\n")
    assert cause in said
    assert not out.exists()
    assert attempt(folder, f"{line} --anyway")[0] == 1
    assert out.exists()
