"""An installation without extras plans, flies and learns; verbs and the doctor name what is missing or is not ours."""

import ast
import json
import os
import re
import subprocess
import sys
import sysconfig
import tomllib
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

import goshawk
import vehicle
from flight import extras, flight_log, project
from goshawk import installation
from tests.test_architecture import MAY_IMPORT, files, imports
from tests.waiting import PATIENCE_S
from vehicle import flights, manoeuvres

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
BY_EXTRA = {extra: set(libraries) for extra, libraries in extras.EXTRAS.items()}
OPTIONAL = set.union(*BY_EXTRA.values())
NEEDED = {"numpy", "scipy", "osqp", "ompl", "pyarrow", "matplotlib", "PIL", "rich", "click", "tomli_w", "pyulog"}
REFUSING = f"""
import sys

class Refusing:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {sorted(name.split(".")[0] for name in OPTIONAL)}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Refusing())
"""
"""As `sitecustomize.py` it makes Python, and what that starts, one without any extra."""
IN_TURN = """
import contextlib, io, json, sys
from goshawk.cli import main

answers = []
for arguments in json.load(sys.stdin):
    said, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(errors):
        try:
            main(arguments)
        except SystemExit as ended:
            answers.append([ended.code, said.getvalue(), errors.getvalue()])
print(json.dumps(answers))
"""
WORKS = {
    "plan": "plan waypoints.json --map map --vehicle vehicle.toml --out plan.json",
    "check": "check plan.json --map map --vehicle vehicle.toml",
    "export": "export plan.json --report plan.html --map map --vehicle vehicle.toml",
    "log": "log show flight.parquet --json",
    "log check": "log check flight.parquet",
    "vehicle": "vehicle show vehicle.toml",
    "identify": "identify flight.parquet --vehicle vehicle.toml --hold-unidentifiable --out learned.toml",
    "compare": "compare flight.parquet --vehicle vehicle.toml --vehicle learned.toml",
    "init": "init project --map map --vehicle vehicle.toml",
    "map measure": "map measure map --first 1,1,1 --second 2,2,1",
    "map edit": "map edit list map",
    "doctor": "doctor --json",
    "sitl": "sitl --help",
    "fly": "fly --help",
}
REFUSES = {
    "map": ("map build images --camera map/camera.toml --out other", "map"),
    "camera": ("camera new images/front --out camera.toml", "map"),
    "gcs": ("gcs project --port 0", "gcs"),
    "log": ("log draft-columns flight.bag --out columns.toml", "ros"),
    "plan batch": (
        "plan batch missions --map map --vehicle vehicle.toml --out batch --scheduler tcp://127.0.0.1:1", "cluster",
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def without_extras(tmp_path_factory, pillar_map) -> dict[str, list]:
    """Exit code, output and error of each verb above, in a Python that has no library of any extra."""
    folder = tmp_path_factory.mktemp("without")
    (folder / "map").symlink_to(pillar_map)
    vehicle.save(folder / "vehicle.toml", vehicle.example())
    truth = flights.fly_trajectory(vehicle.example(), manoeuvres.make("doublets"))
    flight_log.save(folder / "flight.parquet", flights.measure(truth, rng=np.random.default_rng(0)))
    points = np.array([[0.8, 0.8, 1.2], [3.0, 2.6, 1.2], [5.2, 1.0, 1.2]])
    project.save_waypoints(folder / "waypoints.json", project.Waypoints(points, np.full(3, np.nan)))
    (folder / "missions").mkdir()
    (folder / "missions" / "one.json").write_bytes((folder / "waypoints.json").read_bytes())
    (folder / "flight.bag").write_bytes(b"#ROSBAG V2.0\n")
    for image in ("front/0.png", "front/1.png", "down/0.png", "down/1.png"):
        (folder / "images" / image).parent.mkdir(parents=True, exist_ok=True)
        (folder / "images" / image).write_bytes(b"\x89PNG")
    (folder / "refusing").mkdir()
    (folder / "refusing" / "sitecustomize.py").write_text(REFUSING)
    lines = {**WORKS, **{f"{verb} refused": line for verb, (line, _) in REFUSES.items()}}
    environment = os.environ | {"PYTHONPATH": f"{folder / 'refusing'}{os.pathsep}{ROOT}"}
    done = subprocess.run(
        [sys.executable, "-c", IN_TURN], input=json.dumps([line.split() for line in lines.values()]),
        cwd=folder, env=environment, capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return dict(zip(lines, json.loads(done.stdout), strict=True))


@pytest.mark.parametrize("verb", WORKS)
def test_without_any_extra_this_works(verb, without_extras):
    code, _, errors = without_extras[verb]
    assert code == 0, errors


@pytest.mark.parametrize("verb", REFUSES)
def test_a_verb_without_its_extra_says_how_to_install_it(verb, without_extras):
    code, _, errors = without_extras[f"{verb} refused"]
    assert code == 2
    sentence = errors.strip().splitlines()[-1]
    assert re.match(r"goshawk: this verb needs [\w.-]+, which comes with an extra: ", sentence)
    assert sentence.endswith(f'pip install "goshawk[{REFUSES[verb][1]}]"')


def test_the_doctor_is_content_without_extras_and_says_what_each_would_add(without_extras):
    answer = json.loads(without_extras["doctor"][1])
    found = {finding["name"]: finding["detail"] for finding in answer["findings"]}
    assert answer["healthy"]
    for extra, libraries in extras.EXTRAS.items():
        assert f'pip install "goshawk[{extra}]" adds {", ".join(libraries.values())}' in found[f"extra {extra}"]


def test_extras_bring_the_libraries_that_the_table_says():
    asked = PROJECT["optional-dependencies"]
    for extra, libraries in extras.EXTRAS.items():
        brought = {re.split(r"[\s>=;]", wanted)[0].removesuffix("-cpu") for wanted in asked[extra]}
        assert brought == set(libraries.values())
    assert asked["all"] == [f"goshawk[{','.join(extras.EXTRAS)}]"]
    assert "goshawk[all]" in asked["dev"]


def test_every_library_that_the_code_imports_is_asked_for():
    used = {
        name
        for package in MAY_IMPORT
        for path in files(package)
        for module, _, _ in imports(ast.parse(path.read_text()))
        if (name := module.split(".")[0]) not in sys.stdlib_module_names | set(MAY_IMPORT)
    }
    asked = NEEDED | {name.split(".")[0] for name in OPTIONAL}
    assert used - asked == set()
    assert asked - used <= {"dask"}  # distributed is its scheduler
    needed = {re.split(r"[>=]", wanted)[0].replace("-", "_") for wanted in PROJECT["dependencies"]}
    assert needed == {name.replace("PIL", "pillow") for name in NEEDED}


def test_an_error_about_another_module_is_not_about_an_extra():
    assert extras.missing(ModuleNotFoundError("No module named 'esdf.nothing'", name="esdf.nothing")) is None
    assert extras.missing(ModuleNotFoundError("No module named 'cv2.nothing'", name="cv2.nothing")) is None
    assert extras.missing(ImportError("libGL.so.1: cannot open shared object file", name="cv2")) is None


def test_the_version_is_that_of_the_distribution():
    assert goshawk.__version__ == metadata.version("goshawk") == PROJECT["version"]
    assert not hasattr(goshawk, "no_such_name")


def first_import(*places: Path, code: str = "import goshawk") -> subprocess.CompletedProcess[str]:
    """In a Python whose path is these places and the standard library's."""
    begin = f"import sys; sys.path[:0] = {[str(place) for place in places]}; "
    return subprocess.run(
        [sys.executable, "-S", "-P", "-c", begin + code],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )


@pytest.mark.parametrize("name", installation.PACKAGES)
@pytest.mark.parametrize("form", ["{}/__init__.py", "{}.py"])
def test_another_module_of_the_name_of_ours_is_named_when_goshawk_is_imported(name, form, tmp_path):
    decoy = tmp_path / form.format(name)
    decoy.parent.mkdir(exist_ok=True)
    decoy.write_text("raise SystemExit('it was imported')")
    answer = first_import(tmp_path, ROOT)
    error = answer.stderr.strip().splitlines()[-1]
    assert error.startswith(f"ImportError: Python finds another {name!r}, {decoy}, before Goshawk's, {ROOT / name}; ")


def test_the_doctor_says_so_too(tmp_path):
    (tmp_path / "planner.py").touch()
    libraries = Path(sysconfig.get_path("purelib"))
    run = "from goshawk.cli import main; main(['doctor'])"
    answer = first_import(tmp_path, ROOT, libraries, code=run)
    assert f"Python finds another 'planner', {tmp_path / 'planner.py'}" in answer.stderr.splitlines()[-1]


def test_our_own_packages_and_folders_of_their_names_are_no_fault(tmp_path):
    (tmp_path / "planner").mkdir()  # without __init__.py a package of the name comes first, wherever it is
    link = tmp_path / "link"
    link.symlink_to(ROOT)
    assert first_import(tmp_path, link).returncode == 0


def test_a_package_of_ours_that_is_missing_is_named(tmp_path):
    for name in {"goshawk", *installation.PACKAGES} - {"sysid"}:
        (tmp_path / name).symlink_to(ROOT / name)
    assert "ImportError: sysid, a package of Goshawk, is not in" in first_import(tmp_path).stderr


def test_the_doctor_names_a_distribution_that_installs_into_a_package_of_ours(tmp_path):
    record = tmp_path / "route_planner-1.0.dist-info"
    record.mkdir()
    (record / "METADATA").write_text("Metadata-Version: 2.1\nName: route-planner\nVersion: 1.0\n")
    (record / "RECORD").write_text("planner/__init__.py,,\nplanner/route.py,,\n")
    code = "from goshawk import installation; print(installation.other_owners())"
    assert first_import(ROOT, code=code).stdout == "{}\n"
    assert first_import(tmp_path, ROOT, code=code).stdout == "{'planner': ['route-planner']}\n"


def test_every_place_that_has_the_version_has_the_same():
    version = PROJECT["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()
    assert (ROOT / "CHANGELOG.md").read_text().split("\n## ")[1].startswith(f"{version} ")
    named = re.findall(r"goshawk-(\d+\.\d+\.\d+)-", (ROOT / "docs/start/install.md").read_text())
    assert set(named) == {version}


def test_what_the_compiled_modules_contain_of_others_is_shipped_with_its_notices():
    assert "THIRD_PARTY.txt" in PROJECT["license-files"]
    shipped = (ROOT / "THIRD_PARTY.txt").read_text()
    of_nanobind = next(f for f in metadata.files("nanobind") or () if f.name == "LICENSE").read_text()
    assert of_nanobind.strip() in shipped
    inside = Path(str(metadata.distribution("nanobind").locate_file("nanobind/ext"))).iterdir()
    assert {library.name for library in inside} == {"robin_map"}
    assert "Thibaut Goetghebuer-Planchon" in shipped
