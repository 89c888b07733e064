"""`goshawk map show-esdf` and `goshawk map edit`: what a pilot sees and changes in a map, from the command line."""

import json

import cv2
import numpy as np
import pytest

import esdf
from esdf import FREE, OCCUPIED, UNKNOWN, Grid, build
from esdf.edits import difference
from flight import FormatError, InputError
from goshawk.cli import goshawk
from goshawk.commands.map import edit
from mapping.camera import rig as rigs

GRID = Grid((-1.0, -1.0, 0.0), 0.1, (40, 30, 20))


@pytest.fixture
def field():
    state = np.full(GRID.shape, FREE, np.uint8)
    state[:, :, :2] = OCCUPIED
    state[30:, :, :] = UNKNOWN
    return build(state, GRID)


@pytest.fixture
def folder(tmp_path, field):
    esdf.save(tmp_path / "map" / "esdf", field)
    return tmp_path / "map"


def run(capsys, *arguments):
    """Run a verb in this process and read its JSON."""
    goshawk.main([*map(str, arguments), "--json"], prog_name="goshawk", standalone_mode=False)
    return json.loads(capsys.readouterr().out)


def test_the_statistics_are_those_of_the_field(capsys, folder, field):
    said = run(capsys, "map", "show-esdf", folder)
    assert said["hash"] == field.hash
    assert (said["free_m3"], said["occupied_m3"], said["unknown_m3"]) == pytest.approx((16.2, 1.8, 6.0))
    place = np.array([said["roomiest_point_m"]])
    assert field.distance(place)[0] == pytest.approx(said["roomiest_m"], abs=1e-3)
    assert said["roomiest_m"] == pytest.approx(float(field.values_m.max()))
    assert said["free_m3_at_least"]["0.3"] == pytest.approx(float((field.values_m >= 0.3).sum()) * 1e-3)
    assert run(capsys, "map", "show-esdf", folder / "esdf") == said


def test_images_are_written_into_the_given_folder(capsys, folder, tmp_path):
    all_of_it = run(capsys, "map", "show-esdf", folder, "--out", tmp_path / "all")
    assert sorted(p.suffix for p in (tmp_path / "all").iterdir()) == [".ply", ".png", ".png", ".png", ".png"]
    assert {str(p) for p in (tmp_path / "all").iterdir()} == set(all_of_it["written"])
    some = ["--slice", "z=1.0", "--plane", "0,0,0.5", "1,1,0.5", "0,0,1.5", "--iso", "0.3"]
    run(capsys, "map", "show-esdf", folder, "--out", tmp_path / "some", *some)
    assert sorted(p.name for p in (tmp_path / "some").iterdir()) == ["plane_1.png", "slice_z_1.png", "surface_0.3m.ply"]
    for picture in (tmp_path / "some").glob("*.png"):
        assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_map_without_free_or_known_space_still_has_statistics(capsys, tmp_path):
    for kind in (OCCUPIED, UNKNOWN):
        esdf.save(tmp_path / "esdf", build(np.full((4, 4, 4), kind, np.uint8), Grid((0, 0, 0), 0.1, (4, 4, 4))))
        said = run(capsys, "map", "show-esdf", tmp_path)
        assert said["free_m3"] == 0.0
        assert said["roomiest_m"] is None


def test_edits_are_saved_listed_undone_and_dropped(capsys, folder, field):
    add = run(capsys, "map", "edit", "add", folder, "--box", "-0.5,-0.5,0.5,0,0,1", "--name", "shelf")
    assert add["closed_m3"] == pytest.approx(0.125)
    zone = run(capsys, "map", "edit", "no-fly", folder, "corner", "--prism", "0,2,1,1,1.8,1,1.8,1.8")
    assert zone["edits"] == 2
    assert esdf.load(folder / "esdf").hash == zone["hash"]
    assert [e["name"] for e in run(capsys, "map", "edit", "list", folder)["edits"]] == ["shelf", "corner"]
    opened = run(capsys, "map", "edit", "remove", folder, "--turned-box", "2.5,0,1,0.5,0.5,0.5,30")
    assert opened["opened_m3"] == pytest.approx(0.125, rel=0.3)
    assert run(capsys, "map", "edit", "undo", folder)["hash"] == zone["hash"]
    assert run(capsys, "map", "edit", "drop", folder, "corner")["hash"] == add["hash"]
    assert run(capsys, "map", "edit", "undo", folder)["hash"] == field.hash
    esdf.save(folder / "esdf", field)
    assert esdf.open_editor(folder / "esdf").edits == ()


@pytest.mark.parametrize(
    "shape",
    [
        ("--box", "1,1,1,0.5,0.5,0.2"),
        ("--turned-box", "0,0,1,1,0.4,0.4,45"),
        ("--sphere", "0,0,1,0.4"),
        ("--cylinder", "0,0,1,0.2,1"),
        ("--capsule", "0,0,1,1,1,1,0.1"),
        ("--prism", "0.5,1,0,0,1,0,1,1,0,1"),
        ("--stroke", "0.1,0,0,1,1,0,1,1,1,1"),
        ("--outside", "-0.5,-0.5,0.3,1.5,1.5,1.8"),
    ],
)
def test_every_shape_can_be_previewed_without_saving(capsys, folder, field, tmp_path, shape):
    picture = tmp_path / "preview.png"
    tried = run(capsys, "map", "edit", "add", folder, *shape, "--preview", picture)
    assert tried["closed_m3"] > 0.0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert esdf.load(folder / "esdf").hash == field.hash
    assert run(capsys, "map", "edit", "add", folder, *shape)["hash"] == tried["hash"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["edit", "undo", "MAP"], "nothing to undo"),
        (["edit", "drop", "MAP", "attic"], "no edit is called"),
        (["edit", "add", "MAP"], "give one shape"),
        (["edit", "add", "MAP", "--sphere", "0,0,1,1", "--box", "0,0,0,1,1,1"], "give one shape"),
        (["edit", "add", "MAP", "--sphere", "0,0,1"], "not 4 finite numbers"),
        (["edit", "add", "MAP", "--sphere", "0,0,nan,1"], "not 4 finite numbers"),
        (["edit", "add", "MAP", "--sphere", "0,0,1,-1"], "positive"),
        (["edit", "add", "MAP", "--sphere", "90,0,1,1"], "no voxel"),
        (["edit", "add", "MAP", "--prism", "0,1,0,0,1,1,2"], "takes ZLOW"),
        (["edit", "add", "MAP", "--stroke", "1,2,3"], "takes RADIUS"),
        (["show-esdf", "MAP", "--slice", "z=1"], "--out"),
        (["show-esdf", "MAP", "--out", "OUT", "--slice", "w=1"], "x=, y= or z="),
        (["show-esdf", "MAP", "--out", "OUT", "--slice", "z=9"], "outside of it"),
        (["show-esdf", "MAP", "--out", "OUT", "--iso", "9"], "choose another level"),
        (["show-esdf", "MAP", "--out", "OUT", "--plane", "0,0,0", "1,1,1", "2,2,2"], "one line"),
        (["show-esdf", "MAP", "--out", "OUT", "--plane", "0,0,9", "1,0,9", "0,1,9"], "misses"),
        (["show-esdf", "OUT"], "no distance field"),
    ],
)
def test_bad_input_is_refused_with_the_reason_and_changes_nothing(folder, field, tmp_path, arguments, says):
    named = [{"MAP": str(folder), "OUT": str(tmp_path / "out")}.get(a, a) for a in arguments]
    with pytest.raises((InputError, FormatError), match=says):
        goshawk.main(["map", *named], prog_name="goshawk", standalone_mode=False)
    assert esdf.load(folder / "esdf").hash == field.hash
    assert not (folder / "esdf" / "edits.json").exists()


@pytest.mark.parametrize("verb", [["show-esdf"], ["edit"], *[["edit", v] for v in ("add", "no-fly", "undo")]])
def test_the_help_of_every_sub_verb_has_lines_to_paste(capsys, verb):
    goshawk.main(["map", *verb, "--help"], prog_name="goshawk", standalone_mode=False)
    assert capsys.readouterr().out.split("Options:")[0].count("\n  goshawk map ") >= 2


def test_an_edit_that_the_ground_station_made_meanwhile_is_not_written_over(capsys, folder, monkeypatch):
    def at_the_same_time(*fields):
        esdf.save_edits(folder / "esdf" / "edits.json", [theirs])
        return difference(*fields)

    theirs = esdf.Edit("no-fly", esdf.solids.Sphere((0.0, 0.0, 1.0), 0.2), "stairs")
    monkeypatch.setattr(edit, "difference", at_the_same_time)
    with pytest.raises(InputError, match=r"changed .* meanwhile; nothing was written"):
        run(capsys, "map", "edit", "add", folder, "--sphere", "1,0,1,0.2")
    assert esdf.load_edits(folder / "esdf" / "edits.json") == (theirs,)


def test_a_run_that_is_to_stop_says_so_as_json_too(capsys, tmp_path):
    (tmp_path / "images").mkdir()
    rng = np.random.default_rng(0)
    for k in range(3):
        cv2.imwrite(str(tmp_path / "images" / f"{k}.png"), rng.integers(0, 255, (120, 160), dtype=np.uint8))
    rigs.save(tmp_path / "c.toml", rigs.Rig((rigs.forward_camera("PINHOLE", 160, 120, [100, 100, 80, 60]),)))
    given = (tmp_path / "images", "--camera", tmp_path / "c.toml", "--length", 1, "--out", tmp_path / "map")
    assert run(capsys, "map", "build", *given, "--until-stage", "check") == {"stopped_after": "check"}


def test_a_hall_that_does_not_fit_is_refused_before_any_work(capsys, tmp_path):
    (tmp_path / "images").mkdir()
    corners = [(x, y, z) for x in (0, 100) for y in (0, 50) for z in (0, 10)]
    for k in range(8):
        cv2.imwrite(str(tmp_path / "images" / f"{k}.png"), np.full((120, 160), 30 * k, dtype=np.uint8))
    times = "".join(f"{k}.png,{100 * k}\n" for k in range(8))
    (tmp_path / "images" / "times.csv").write_text("image,time_s\n" + times)
    time_s = np.arange(701.0)
    path = [np.interp(time_s, 100.0 * np.arange(8), axis) for axis in np.array(corners).T]
    poses = [f"{t} {x} {y} {z} 0 0 0 1\n" for t, x, y, z in zip(time_s, *path, strict=True)]
    (tmp_path / "p.tum").write_text("".join(poses))
    rigs.save(tmp_path / "c.toml", rigs.Rig((rigs.forward_camera("PINHOLE", 160, 120, [100, 100, 80, 60]),)))
    given = (tmp_path / "images", "--camera", tmp_path / "c.toml", "--poses", tmp_path / "p.tum")
    with pytest.raises(InputError, match=r"between the recorded poses \(p.tum\) has 400 million voxels"):
        run(capsys, "map", "build", *given, "--out", tmp_path / "map")
    assert not (tmp_path / "map.work").exists()


def test_a_video_is_to_be_checked_by_its_frames(tmp_path):
    rigs.save(tmp_path / "c.toml", rigs.Rig((rigs.forward_camera("PINHOLE", 160, 120, [100, 100, 80, 60]),)))
    (tmp_path / "walk.mp4").write_bytes(b"")
    with pytest.raises(InputError, match=r"--until-stage frames, then check the folder MAP\.work/frames"):
        goshawk.main(
            ["map", "check", str(tmp_path / "walk.mp4"), "--camera", str(tmp_path / "c.toml")],
            standalone_mode=False,
        )
