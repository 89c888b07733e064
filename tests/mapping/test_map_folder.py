"""The map folder: whole or absent, opened or refused, and what a bad folder of images leaves behind (nothing)."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

import esdf
import mapping
from esdf.solids import Sphere
from esdf.storage import EDITS
from esdf.visibility import save_visibility
from flight import FlightError, FloatArray, FormatError, InputError, MapError, file_format, frames, rotations
from mapping import map_folder, stages
from mapping.camera import rig as rigs
from mapping.camera.trial import Trial
from mapping.input.images import ImageSet
from mapping.localization import relocalization
from mapping.map_folder import MapOptions
from mapping.sparse import localization_map, reconstruction
from mapping.sparse.alignment import Alignment
from mapping.sparse.calibration.calibration import SparseModel
from mapping.sparse.mapper.colmap import SparseOptions
from mapping.sparse.reconstruction import SparseMap

RIG = rigs.Rig((rigs.forward_camera("SIMPLE_RADIAL_FISHEYE", 160, 120, [90.0, 80.0, 60.0, 0.0]),))


def write_images(folder: Path, pictures: list[np.ndarray]) -> Path:
    folder.mkdir()
    for k, picture in enumerate(pictures):
        cv2.imwrite(str(folder / f"{k:02d}.png"), picture)
    return folder


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 255, (120, 160), dtype=np.uint8)


def made_map(folder: Path) -> Path:
    """A map folder around a small field, written with the functions `build_map` writes with."""
    grid = esdf.Grid((0.0, 0.0, 0.0), (0.1, 0.1, 0.1), (8, 9, 10))
    state = np.full(grid.shape, esdf.FREE, dtype=np.uint8)
    state[3:5] = esdf.OCCUPIED
    field = esdf.build(state, grid)
    placed = sparse_map(folder)
    with file_format.atomic_folder(folder) as new:
        esdf.save(new / "esdf", field)
        localization_map.save(new / "localization", placed.localization_map())
        rigs.save(new / "camera.toml", RIG)
        mapping.write_poses(new / "poses.csv", placed.images.instants, placed.images.time_s, placed.T_world_body)
        file_format.write_toml(new / "map.toml", format=map_folder.FORMAT, version=1, body={"hash": field.hash})
    return folder


def sparse_map(folder: Path) -> SparseMap:
    poses: FloatArray = frames.transform(rotations.exp([[0.1, 0.2, k] for k in range(3)]), np.arange(9.0).reshape(3, 3))
    poses[1] = np.nan
    images = ImageSet(folder, RIG, ("a.png", "b.png", "c.png"), np.ones((3, 1), bool), np.array([0.0, 0.5, np.nan]))
    descriptors = np.abs(np.random.default_rng(0).normal(size=(20, 128))).astype(np.float32)
    descriptors /= np.linalg.norm(descriptors, axis=1, keepdims=True)
    return SparseMap(
        images=images,
        T_world_body=poses,
        registered=np.array([[True], [False], [True]]),
        points_world_m=np.random.default_rng(1).normal(size=(20, 3)),
        descriptors=descriptors,
        observations=np.zeros((0, 3), dtype=np.int64),
        pixels=np.zeros((0, 2)),
        reprojection_error_px=0.3,
        least_agreement=0.99,
        breaks=np.zeros((0, 2), int),
        overlaps=np.zeros((0, 3), int),
        repeated=0.05,
        by_motion=[],
        motion_notes=[],
        trial=Trial((), RIG, poses, np.zeros((20, 3)), 0.2, 0.001),
        alignment=Alignment(1.0, np.eye(4), "rig baseline", "recorded gravity"),
        cpu_s={},
    )


def test_a_map_opens_as_it_was_written(tmp_path: Path) -> None:
    opened = mapping.open_map(made_map(tmp_path / "map"))
    placed = sparse_map(tmp_path)
    assert opened.images == ("a.png", "c.png")
    np.testing.assert_allclose(opened.T_world_body, placed.T_world_body[[0, 2]], atol=1e-8)
    assert opened.time_s[0] == 0.0
    assert np.isnan(opened.time_s[1])
    assert opened.hash == opened.field.hash == opened.facts["hash"]
    known = opened.localization_map()
    np.testing.assert_allclose(known.points_world_m, placed.points_world_m, rtol=0.0, atol=5.1e-4)
    assert ((known.descriptors * placed.descriptors).sum(axis=1) > 0.97).all()


def test_what_the_images_resolve_is_read_from_the_map_and_computed_for_an_earlier_one(tmp_path: Path) -> None:
    opened = mapping.open_map(made_map(tmp_path / "map"))
    computed = opened.visibility()
    assert computed.grid.high_world_m[0] >= opened.field.grid.high_world_m[0]
    kept = dataclasses.replace(computed, finest_m=np.full_like(computed.finest_m, 0.07))
    save_visibility(opened.folder / map_folder.VISIBILITY, kept)
    np.testing.assert_array_equal(opened.visibility().finest_m, kept.finest_m)
    moved = dataclasses.replace(kept, grid=esdf.Grid((0.1, 0.0, 0.0), kept.grid.voxel_m, kept.grid.shape))
    save_visibility(opened.folder / map_folder.VISIBILITY, moved)
    with pytest.raises(FormatError, match="unlike the map's"):
        opened.visibility()
    save_visibility(opened.folder / map_folder.VISIBILITY, dataclasses.replace(kept, finest_m=kept.finest_m * np.nan))
    with pytest.raises(FormatError, match="not all thicknesses are positive"):
        opened.visibility()
    (opened.folder / map_folder.VISIBILITY).write_bytes(b"cut off")
    with pytest.raises(FormatError, match="damaged"):
        opened.visibility()


def test_a_folder_that_is_no_map_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not a map"):
        mapping.open_map(tmp_path)


@pytest.mark.parametrize("name", ["poses.csv", "camera.toml", "localization/points.bin", "esdf/esdf.toml"])
def test_a_damaged_map_is_refused(tmp_path: Path, name: str) -> None:
    folder = made_map(tmp_path / "map")
    (folder / name).write_bytes(b"image,nothing\n")
    with pytest.raises((FormatError, InputError)):
        mapping.open_map(folder).localization_map()


def test_poses_that_were_cut_off_within_a_line_are_refused_by_the_image(tmp_path: Path) -> None:
    path = made_map(tmp_path / "map") / "poses.csv"
    whole = path.read_text()
    path.write_text(whole[: whole.index("c.png,") + len("c.png,1,0.5")])
    with pytest.raises(FormatError, match=r"c\.png has no whole pose; build the map again"):
        mapping.open_map(tmp_path / "map")


def failing(images: Path, out: Path) -> str:
    """The message of the failure; an earlier map in `out` must have survived it."""
    hash = mapping.open_map(made_map(out)).hash
    before = sorted(p.relative_to(out) for p in out.rglob("*"))
    with pytest.raises(FlightError) as caught:
        mapping.build_map(images, RIG, out, MapOptions(length=mapping.Length(1.0)), overwrite=True)
    assert mapping.open_map(out).hash == hash
    assert sorted(p.relative_to(out) for p in out.rglob("*")) == before
    assert not [p for p in out.parent.iterdir() if p.name.startswith(".")]
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_images_that_show_nothing_in_common_leave_the_old_map(tmp_path: Path) -> None:
    images = write_images(tmp_path / "images", [noise(k) for k in range(4)])
    assert "no map" in failing(images, tmp_path / "map")


def test_blank_images_leave_the_old_map(tmp_path: Path) -> None:
    images = write_images(tmp_path / "images", [np.full((120, 160), 90, np.uint8)] * 3)
    assert "no map" in failing(images, tmp_path / "map")


def test_one_image_again_and_again_is_no_map(tmp_path: Path) -> None:
    images = write_images(tmp_path / "images", [noise(1)] * 5)
    assert "no map" in failing(images, tmp_path / "map")


def test_a_damaged_image_leaves_the_old_map(tmp_path: Path) -> None:
    images = write_images(tmp_path / "images", [noise(k) for k in range(4)])
    (images / "02.png").write_bytes(b"torn")
    assert "02.png is damaged" in failing(images, tmp_path / "map")


def test_a_folder_with_other_things_is_not_overwritten(tmp_path: Path) -> None:
    images = write_images(tmp_path / "images", [noise(k) for k in range(4)])
    out = tmp_path / "thesis"
    out.mkdir()
    (out / "chapter1.tex").write_text("precious")
    with pytest.raises(InputError, match="not a result"):
        mapping.build_map(images, RIG, out, overwrite=True)
    assert (out / "chapter1.tex").read_text() == "precious"


def test_an_earlier_map_is_refused_before_the_images_are_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--overwrite"):
        mapping.build_map(tmp_path / "none", RIG, made_map(tmp_path / "map"))


def test_a_length_from_an_image_that_is_not_there_is_refused_before_any_stage(tmp_path: Path) -> None:
    images = write_images(tmp_path / "images", [noise(k) for k in range(4)])
    options = MapOptions(length=mapping.Length(1.0, ("00.png", "17.png")))
    with pytest.raises(InputError, match=r"has no '17\.png'; its 4 images go from 00\.png to 03\.png"):
        mapping.build_map(images, RIG, tmp_path / "map", options)
    assert not (tmp_path / "map.work").exists()


def test_a_rig_without_images_of_one_name_has_no_scale_of_its_own(tmp_path: Path) -> None:
    first = dataclasses.replace(RIG.cameras[0], folder="left")
    aside = frames.transform([1.0, 0.0, 0.0, 0.0], [0.0, 0.1, 0.0]) @ first.T_body_camera
    other = dataclasses.replace(first, name="right", folder="right", T_body_camera=aside)
    rig = rigs.Rig((first, other))
    (tmp_path / "images").mkdir()
    write_images(tmp_path / "images" / "left", [noise(k) for k in range(3)])
    write_images(tmp_path / "images" / "right", [noise(k) for k in range(3)])
    with pytest.raises(stages.StoppedError):
        mapping.build_map(tmp_path / "images", rig, tmp_path / "map", until="check")
    for image in (tmp_path / "images" / "right").iterdir():
        image.rename(image.with_stem(f"right {image.stem}"))
    with pytest.raises(MapError, match=r"no metric scale: .* without images of one name"):
        mapping.build_map(tmp_path / "images", rig, tmp_path / "new")
    assert not (tmp_path / "new.work").exists()
    options = MapOptions(length=mapping.Length(1.0))
    with pytest.raises(stages.StoppedError):
        mapping.build_map(tmp_path / "images", rig, tmp_path / "new", options, until="check")


def test_interrupt_leaves_the_old_map(tmp_path: Path) -> None:
    images = write_images(tmp_path / "images", [noise(k) for k in range(4)])
    out = made_map(tmp_path / "map")

    def interrupted(stage: str, fraction: float) -> None:
        if stage == "matching features":
            raise KeyboardInterrupt

    options = MapOptions(length=mapping.Length(1.0))
    with pytest.raises(KeyboardInterrupt):
        mapping.build_map(images, RIG, out, options, overwrite=True, progress=interrupted)
    assert mapping.open_map(out).images == ("a.png", "c.png")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["images", "map", "map.work"]
    assert stages.finished(tmp_path / "map.work", map_folder.STAGES) == ["check", "features"]


def interrupted_work(out: Path, replaced: bool) -> None:
    """What a killed run leaves beside `out`; with `replaced` one that had moved the earlier map aside."""
    with stages.begin(map_folder.work_folder(out)) as work:
        map_folder._note_replaced(out, work)
    if replaced:
        out.rename(out.with_name(f"{out.name}.old-3"))


def test_a_map_that_a_killed_run_had_moved_aside_is_put_back(tmp_path: Path) -> None:
    images = write_images(tmp_path / "images", [noise(k) for k in range(4)])
    out, options = made_map(tmp_path / "map [1]"), MapOptions(length=mapping.Length(1.0))
    esdf.save_edits(out / "esdf" / EDITS, [esdf.Edit("add", Sphere((0.4, 0.4, 0.4), 0.1), "the pilot's")])
    hash = mapping.open_map(out).hash
    interrupted_work(out, replaced=True)
    made_map(tmp_path / "map [1].old-1")  # of an earlier replacement
    with pytest.raises(InputError, match="exists"):
        mapping.build_map(images, RIG, out, options)
    assert mapping.open_map(out).hash == hash
    assert sorted(p.name for p in tmp_path.glob("map*")) == ["map [1]", "map [1].old-1", "map [1].work"]


def test_a_map_that_the_user_moved_away_is_not_put_back(tmp_path: Path) -> None:
    images = write_images(tmp_path / "images", [noise(k) for k in range(4)])
    out, options = made_map(tmp_path / "map"), MapOptions(length=mapping.Length(1.0))
    interrupted_work(out, replaced=False)
    with pytest.raises(MapError):
        mapping.build_map(images, RIG, out, options, overwrite=True)
    out.rename(tmp_path / "map.old-1")
    with pytest.raises(MapError):
        mapping.build_map(images, RIG, out, options)
    assert not out.exists()


def test_a_damaged_map_is_replaced_after_an_interrupt_too(tmp_path: Path) -> None:
    images = write_images(tmp_path / "images", [noise(k) for k in range(4)])
    out, options = made_map(tmp_path / "map"), MapOptions(length=mapping.Length(1.0))
    interrupted_work(out, replaced=False)
    (out / "camera.toml").write_text("torn")
    with pytest.raises(MapError, match="no map"):
        mapping.build_map(images, RIG, out, options, overwrite=True)


def test_the_work_lies_beside_the_map_that_a_link_leads_to(tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    (tmp_path / "link").symlink_to(made_map(tmp_path / "disk" / "map"))
    assert map_folder.work_folder(tmp_path / "link") == map_folder.work_folder(tmp_path / "disk" / "map")
    assert map_folder.work_folder(tmp_path / "disk" / "map") == tmp_path / "disk" / "map.work"


def test_changed_images_and_options_make_exactly_what_depends_on_them_again(tmp_path: Path) -> None:
    images, out = write_images(tmp_path / "images", [noise(k) for k in range(4)]), tmp_path / "map"
    features = map_folder.work_folder(out) / "features"

    def made(options: MapOptions) -> int:
        with pytest.raises(stages.StoppedError, match="after features"):
            mapping.build_map(images, RIG, out, options, until="features")
        return (features / "inputs").stat().st_mtime_ns

    first = made(MapOptions(length=mapping.Length(1.0)))
    assert made(MapOptions(length=mapping.Length(2.0), dense=mapping.DenseOptions(voxel_m=0.1))) == first
    other = made(MapOptions(SparseOptions(features=200), length=mapping.Length(1.0)))
    (images / "00.png").write_bytes((images / "01.png").read_bytes())
    assert len({first, other, made(MapOptions(SparseOptions(features=200), length=mapping.Length(1.0)))}) == 3
    assert sorted(p.name for p in tmp_path.iterdir()) == ["images", "map.work"]


def test_matching_is_mutual_and_clear() -> None:
    rng = np.random.default_rng(2)
    known = rng.normal(size=(300, 128)).astype(np.float32)
    known /= np.linalg.norm(known, axis=1, keepdims=True)
    known[1] = known[0]  # a doubled point is never clear
    query = known[[7, 0, 250]] + 0.01 * rng.normal(size=(3, 128)).astype(np.float32)
    query /= np.linalg.norm(query, axis=1, keepdims=True)
    chosen, points = relocalization.match(query, known, 0.85)
    assert chosen.tolist() == [0, 2]
    assert points.tolist() == [7, 250]


def test_empty_descriptors_have_no_matches() -> None:
    empty = np.zeros((0, 128), dtype=np.float32)
    assert len(relocalization.match(empty, empty, 0.8)[0]) == 0
    with pytest.raises(InputError):
        localization_map.load(Path("nowhere"))


def test_colmap_options_out_of_range_are_refused() -> None:
    for wrong in ({"features": 10}, {"window": 0}, {"similar": -1}):
        with pytest.raises(InputError):
            SparseOptions(**wrong)


def test_images_are_placed_and_the_calibration_is_tried_in_two_children_of_one_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[tuple[str, tuple[object, ...], set[object]]] = []

    def run(work: Callable[..., object], *arguments: object, **where: object) -> object:
        calls.append((work.__name__, arguments, {where["within"], where["lock"]}))
        if work.__name__ == "calibrate":
            raise MapError("killed")
        return "placed"

    monkeypatch.setattr("mapping.child.run", run)
    images, options = sparse_map(tmp_path).images, SparseOptions()
    with stages.begin(tmp_path / "work") as work, pytest.raises(MapError, match="killed"):
        reconstruction.reconstruct(images, options, work=work)
    (placing, _, of_placing), (trying, given, of_trying) = calls
    assert (placing, trying, given) == ("place_images", "calibrate", (images, options, "placed"))
    assert of_placing == of_trying == {work.folder, work.lock}


def test_too_few_placed_images_are_no_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    images = sparse_map(tmp_path).images
    model = SparseModel(
        rig=RIG, T_world_body=np.stack([np.eye(4), *[np.full((4, 4), np.nan)] * 2]), points_world=np.zeros((0, 3)),
        registered=np.zeros((3, 1), bool), descriptors=np.zeros((0, 128)), observations=np.zeros((0, 3), int),
        pixels=np.zeros((0, 2)), reprojection_error_px=0.3, least_agreement=1.0, breaks=np.zeros((0, 2), int),
        overlaps=np.array([[0, 1, 16]]), repeated=0.05, by_motion=[], motion_notes=[],
        trial=Trial((), RIG, np.zeros((3, 4, 4)), np.zeros((0, 3)), 0.2, 0.001), cpu_s={},
    )  # fmt: skip
    monkeypatch.setattr("mapping.child.run", lambda *_, **__: model)
    with pytest.raises(MapError, match=r"only 1 of 3 images.*16 between a.png and b.png"):
        reconstruction.reconstruct(images)
