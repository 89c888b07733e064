"""`goshawk vehicle new` and `schema`, as typed."""

import json
import tomllib
from dataclasses import replace

import jsonschema
import pytest

import vehicle
from tests.goshawk.running import run
from vehicle import presets

KNOWN = ("--hover-rpm", 11_530, "--max-rpm", 28_000)
SHEET = ("--mass", 0.72, "--arm", 0.125, "--prop-diameter", 0.127)


def test_a_data_sheet_becomes_a_file_in_which_every_default_is_marked(tmp_path):
    out = tmp_path / "mine.toml"
    said = run("vehicle", "new", out, *SHEET)
    made = vehicle.load(out)
    assert made.name == "mine"
    assert made.parameter("mass_kg").source.startswith("given on the command line")
    for name in ("inertia_xx_kg_m2", "thrust_quadratic.k_n_s2", "rotor_yaw_torque.torque_n_m_s2"):
        assert made.parameter(name).source.startswith("estimated")
        assert made.parameter(name).std > 0.0
    assert made.parameter("motor_lag.rise_s").source.startswith("default")
    assert "are defaults or estimates" in said
    assert sum(line.startswith("#") for line in out.read_text().splitlines()) >= 8


def test_limits_fit_the_vehicle_and_are_fitted_anew_by_set(tmp_path):
    out = tmp_path / "fast.toml"
    said = run("vehicle", "new", out, *SHEET, *KNOWN)
    assert "limits: usual: 10 m/s" in said
    assert "from 5.9 ± 0.6 times its weight" in said
    slow = vehicle.load(out).limits
    said = run("vehicle", "set", out, "limits=race", "limits.jerk_m_s3=200")
    assert "limits.speed_m_s: 10 -> 23" in said
    raced = vehicle.load(out).limits
    assert raced.speed_m_s > slow.speed_m_s
    assert raced.jerk_m_s3 == 200.0
    said = run("vehicle", "new", tmp_path / "race.toml", *SHEET, *KNOWN, "--limits", "race")
    assert "limits: race: 23 m/s" in said
    assert vehicle.load(tmp_path / "race.toml").limits.speed_m_s == raced.speed_m_s
    assert "careful, usual, race" in run("vehicle", "set", out, "limits=fast", code=2)


def test_a_preset_fits_what_is_set_with_it_in_any_order(tmp_path):
    values = ("mass_kg=1.4", "limits=race", "limits.rotor_speed_max_rad_s=2000", "limits.speed_m_s=5")
    limits = []
    for number, order in enumerate((values, values[::-1])):
        out = tmp_path / f"{number}.toml"
        run("vehicle", "new", out, *SHEET, *KNOWN)
        assert "warning" not in run("vehicle", "set", out, *order)
        limits.append(vehicle.load(out).limits)
    assert limits[0] == limits[1]
    heavier = vehicle.load(tmp_path / "0.toml")
    assert limits[0] == replace(presets.limits(heavier, "race"), speed_m_s=5.0)


def test_a_set_that_leaves_limits_beyond_the_thrust_warns(tmp_path):
    out = tmp_path / "v.toml"
    run("vehicle", "new", out, *SHEET, *KNOWN, "--limits", "race")
    assert "warning: limits.acceleration_m_s2 is" in run("vehicle", "set", out, "mass_kg=2.5")
    told = json.loads(run("vehicle", "set", out, "mass_kg=2.6", "--json"))
    assert "times the weight" in told["warnings"][0]


def test_props_out_turns_every_rotor_the_other_way(tmp_path):
    run("vehicle", "new", tmp_path / "in.toml", *SHEET)
    said = run("vehicle", "new", tmp_path / "out.toml", *SHEET, "--props-out")
    usual, other = (vehicle.load(tmp_path / name) for name in ("in.toml", "out.toml"))
    assert (other.spin == -usual.spin).all()
    assert (other.hub_body_m == usual.hub_body_m).all()
    assert "rotors 0 to 3 counter-clockwise, clockwise" in said


def test_an_existing_file_is_replaced_only_with_overwrite_and_then_kept_beside_it(tmp_path):
    out = tmp_path / "mine.toml"
    out.write_text("my notes")
    assert "--overwrite" in run("vehicle", "new", out, *SHEET, code=2)
    assert out.read_text() == "my notes"
    run("vehicle", "new", out, *SHEET, "--overwrite")
    assert (tmp_path / "mine.toml.old-1").read_text() == "my notes"
    assert vehicle.load(out).mass_kg == 0.72


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--mass", 0.7), "--arm"),
        (("--mass", "nan", "--arm", 0.1, "--prop-diameter", 0.1), "positive number"),
        (("--mass", -1, "--arm", 0.1, "--prop-diameter", 0.1), "positive number"),
        (("--mass", 700, "--arm", 125, "--prop-diameter", 127), "in m"),
        (("--mass", 2000, "--arm", 0.1, "--prop-diameter", 0.1), "--mass is 2000 kg"),
        (("--import", "x.step"), "suffix"),
        (("--import", "none.params"), "does not exist"),
        ((*SHEET, "--max-rpm", 100), "does not lift its weight"),
    ],
)
def test_incomplete_or_invalid_data_makes_no_vehicle_file(tmp_path, options, words):
    out = tmp_path / "v.toml"
    assert words in run("vehicle", "new", out, *options, code=2)
    assert not out.exists()


def test_without_a_terminal_there_is_no_prompt():
    assert "give the file to write" in run("vehicle", "new", code=2)


def test_the_schema_accepts_what_new_writes_and_refuses_a_wrong_unit(tmp_path):
    run("vehicle", "new", tmp_path / "v.toml", *SHEET)
    described = json.loads(run("vehicle", "schema"))
    document = tomllib.loads((tmp_path / "v.toml").read_text())
    jsonschema.validate(document, described)
    document["body"]["mass_kg"]["unit"] = "g"
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(document, described)


def test_the_schema_knows_every_effect_of_the_catalogue():
    described = json.loads(run("vehicle", "schema"))
    assert set(described["properties"]["effect"]["properties"]) == set(vehicle.effects.catalogue())


@pytest.mark.parametrize(
    ("frame", "rotors"), [("hex", 6), ("hex+", 6), ("octo", 8), ("octo+", 8), ("y6", 6), ("x8", 8)]
)
def test_a_frame_of_six_or_eight_is_made_shown_and_set(tmp_path, frame, rotors):
    out = tmp_path / "more.toml"
    said = run("vehicle", "new", out, "--frame", frame, "--mass", 1.6, "--arm", 0.28, "--prop-diameter", 0.23)
    assert f"{frame} frame" in said
    made = vehicle.load(out)
    assert made.rotors == rotors
    shown = json.loads(run("vehicle", "show", out, "--json"))
    assert len(shown["rotors"]) == rotors
    run("vehicle", "set", out, "limits=race")
    assert vehicle.load(out).limits.speed_m_s > made.limits.speed_m_s
    jsonschema.validate(tomllib.loads(out.read_text()), json.loads(run("vehicle", "schema")))


def test_rotors_are_numbered_as_a_firmware_numbers_its_motors(tmp_path):
    sheet = ("--frame", "hex", "--mass", 1.6, "--arm", 0.28, "--prop-diameter", 0.23)
    said = run("vehicle", "new", tmp_path / "six.toml", *sheet, "--motor-order", "ardupilot")
    assert "ArduPilot's motors of Hexa X" in said
    six = vehicle.load(tmp_path / "six.toml")
    assert six.hub_body_m[0] == pytest.approx([0.0, -0.28, 0.0], abs=1e-6)
    assert six.spin.tolist() == [-1, 1, -1, 1, 1, -1]
    wrong = ("--frame", "y6", *sheet[2:], "--motor-order", "px4")
    assert "not known in the order of px4" in run("vehicle", "new", tmp_path / "y.toml", *wrong, code=2)


def test_a_motor_order_beside_imported_places_is_refused_unless_a_frame_is_laid_out(tmp_path):
    listed = tmp_path / "six.params"
    places = [f"CA_ROTOR{i}_P{axis}\t{v}" for i, (x, y) in enumerate(((1, 1), (-1, -1), (1, -1), (-1, 1)))
              for axis, v in (("X", 0.2 * x), ("Y", 0.2 * y))]  # fmt: skip
    rows = ["CA_ROTOR_COUNT\t4", *places, *[f"CA_ROTOR{i}_KM\t{0.05 if i < 2 else -0.05}" for i in range(4)]]
    listed.write_text("\n".join(f"1\t1\t{row}\t{6 if 'COUNT' in row else 9}" for row in rows) + "\n")
    sheet = ("--import", listed, "--mass", 1.6, "--prop-diameter", 0.2, "--motor-order", "ardupilot")
    said = run("vehicle", "new", tmp_path / "a.toml", *sheet, code=2)
    assert "--motor-order would not change the imported order" in said
    assert "ArduPilot's motors" in run("vehicle", "new", tmp_path / "a.toml", *sheet, "--frame", "hex", "--arm", 0.28)


@pytest.mark.parametrize("verb", ["sitl", "params"])
def test_what_flies_the_embedded_mixer_refuses_six_rotors_at_once(tmp_path, verb):
    out = tmp_path / "six.toml"
    run("vehicle", "new", out, "--frame", "hex", "--mass", 1.6, "--arm", 0.28, "--prop-diameter", 0.23)
    said = (
        run("sitl", "--vehicle", out, code=2)
        if verb == "sitl"
        else run("params", "set", "--vehicle", out, "--dry-run", code=2)
    )
    assert "mixer drives four rotors along body z; this vehicle has 6 rotors" in said
    assert "goshawk fly PLAN --on" in said
