"""New maps of old ones: moved, cropped, joined. The truth is a room of formulas, seen from both ends."""

import dataclasses
import functools
from pathlib import Path

import numpy as np
import pytest

import esdf
import mapping
from esdf import Edit
from esdf.solids import Box, Room, Scene, Sphere
from flight import FormatError, InputError, MapError, frames, rotations
from mapping import map_parts, merging
from mapping.camera import rig as rigs
from mapping.dense import confidence, resolution
from mapping.dense.confidence import SurfaceConfidence
from mapping.map_parts import MapParts
from mapping.sparse.features import features
from mapping.sparse.localization_map import LocalizationMap
from mapping.verdict import Standing

RIG = rigs.Rig((rigs.forward_camera("SIMPLE_RADIAL_FISHEYE", 160, 120, [90.0, 80.0, 60.0, 0.0]),))
ROOM = Scene((Room((0.0, 0.0, 0.0), (6.0, 4.0, 2.4)), Box((2.0, 1.0, 0.0), (2.6, 1.8, 1.5))))
GRID = esdf.Grid.covering([-0.2, -0.2, -0.2], [6.2, 4.2, 2.6], 0.1)
POSES = frames.transform(rotations.from_yaw([0.0, 0.3, 0.6]), [[1.0, 2.0, 1.0], [3, 3, 1], [5, 2, 1]])
ZONE = Edit("no-fly", Box((4.5, 0.5, 0.0), (5.5, 1.5, 2.0)), "kitchen")


def room(name: str = "room", *, scene: Scene = ROOM, seed: int = 0, noise_m: float = 0.002) -> MapParts:
    """A map of the whole room; points and descriptors are the same in every map of it but for their noise."""
    points, rng = surface(scene, 900), np.random.default_rng(seed)
    looks = np.random.default_rng(7).gamma(0.6, 1.0, (len(points), 128))
    descriptors = features.unit(looks * rng.uniform(0.8, 1.25, looks.shape))
    vertices = surface(scene, 6000)
    facts = {
        "verdict": "good", "reasons": [], "images": 3, "scale_source": "rig baseline", "carrier_radius_m": 0.2,
    }  # fmt: skip
    field = esdf.build(esdf.rasterize(scene, GRID), GRID)
    return MapParts(
        name=name,
        field=field,
        edits=(ZONE,),
        vertices_world_m=vertices,
        faces=np.arange(len(vertices) // 3 * 3, dtype=np.int32).reshape(-1, 3),
        colours=np.full((len(vertices), 3), 128, np.uint8),
        confidence=SurfaceConfidence(
            rng.uniform(0.002, 0.08, len(vertices)).astype(np.float16).astype(np.float32),
            rng.integers(1, 40, len(vertices), dtype=np.uint8),
        ),
        known=LocalizationMap(points + noise_m * rng.normal(size=points.shape), descriptors),
        rig=RIG,
        images=("a.png", "b.png", "c.png"),
        time_s=np.array([0.0, 0.5, np.nan]),
        T_world_body=POSES,
        seen=resolution.visibility(
            field.state, GRID, [(RIG.cameras[0], T @ RIG.cameras[0].T_body_camera) for T in POSES]
        ),
        inferred=np.zeros(field.grid.shape, bool),
        facts=facts,
        report={"images": 3},
    )


@functools.cache
def surface(scene: Scene, count: int) -> np.ndarray:
    """(count, 3) points of the surface, by steps along the distance."""
    points = np.random.default_rng(3).uniform([0.05] * 3, [5.95, 3.95, 2.35], (count, 3))
    for _ in range(60):
        distance = scene.distance(points)
        ahead = [scene.distance(points + 1e-5 * np.eye(3)[k]) - distance for k in range(3)]
        points = points - distance[:, None] * np.stack(ahead, axis=1) / 1e-5
    return points[np.abs(scene.distance(points)) < 1e-3]


def half(parts: MapParts, low: float, high: float) -> MapParts:
    return map_parts.cropped(parts, Box((low, -1.0, -1.0), (high, 5.0, 3.0)), "half")


def rigid(yaw_rad: float = 0.7) -> np.ndarray:
    return frames.transform(rotations.exp([0.02, -0.01, yaw_rad]), [2.0, -3.0, 0.4])


def test_a_map_that_is_written_and_read_is_the_same(tmp_path: Path) -> None:
    given = room()
    hash = map_parts.write(tmp_path / "map", given)
    opened = mapping.open_map(tmp_path / "map")
    assert opened.hash == hash != given.field.hash  # the no-fly zone is in it
    back = map_parts.read(tmp_path / "map")
    assert (back.field.hash, back.edits, back.images) == (given.field.hash, given.edits, given.images)
    np.testing.assert_allclose(back.vertices_world_m, given.vertices_world_m, atol=1e-5)
    np.testing.assert_allclose(back.T_world_body, given.T_world_body, atol=1e-8)


def test_an_earlier_map_stays_unless_it_is_to_be_replaced(tmp_path: Path) -> None:
    map_parts.write(tmp_path / "map", room())
    with pytest.raises(InputError, match="exists"):
        map_parts.write(tmp_path / "map", half(room(), 0.0, 3.0))
    map_parts.write(tmp_path / "map", half(room(), 0.0, 3.0), overwrite=True)
    assert mapping.open_map(tmp_path / "map.old-1").images == room().images


@pytest.mark.parametrize("damage", [b"", b"ply\nformat ascii 1.0\nend_header\n", None])
def test_a_map_with_a_damaged_mesh_is_refused(tmp_path: Path, damage: bytes | None) -> None:
    map_parts.write(tmp_path / "map", room())
    mesh = tmp_path / "map" / "mesh.ply"
    mesh.write_bytes(damage if damage is not None else mesh.read_bytes()[:-40])
    with pytest.raises(FormatError, match=r"mesh\.ply is damaged"):
        map_parts.read(tmp_path / "map")


def test_a_refused_map_is_not_taken_for_a_part(tmp_path: Path) -> None:
    given = room()
    map_parts.write(tmp_path / "map", dataclasses.replace(given, facts=given.facts | {"verdict": "refused"}))
    with pytest.raises(InputError, match="must not be planned in"):
        map_parts.read(tmp_path / "map")


def test_all_parts_of_a_moved_map_move_together_and_come_back() -> None:
    given, T = room(), frames.transform(rotations.from_yaw(0.7), [2.0, -3.0, 0.4])
    new = map_parts.moved(given, T, "moved")
    np.testing.assert_allclose(new.T_world_body, T @ given.T_world_body)
    np.testing.assert_allclose(new.known.points_world_m, frames.apply(T, given.known.points_world_m))
    zone, centre = new.edits[0].solid, frames.apply(T, np.array([[5.0, 1.0, 1.0]]))
    assert zone.distance(centre)[0] == pytest.approx(-0.5)
    assert new.field.hash != given.field.hash
    assert new.facts["history"] == ["moved"]
    back = map_parts.moved(new, frames.invert(T), "and back")
    np.testing.assert_allclose(back.vertices_world_m, given.vertices_world_m, atol=1e-9)
    assert back.facts["history"] == ["moved", "and back"]


def test_no_free_space_of_a_turned_room_is_inside_matter() -> None:
    T = rigid()
    new = map_parts.moved(dataclasses.replace(room(), edits=()), T, "moved")
    free = new.field.grid.centre(np.argwhere(new.field.state == esdf.FREE))
    assert len(free) > 20_000
    assert (ROOM.distance(frames.apply(frames.invert(T), free)) > 0.0).all()


@pytest.mark.parametrize("T", [np.diag([2.0, 2.0, 2.0, 1.0]), np.diag([-1.0, 1.0, 1.0, 1.0]), np.full((4, 4), np.nan)])
def test_what_is_no_rigid_motion_is_refused(T: np.ndarray) -> None:
    with pytest.raises(InputError, match="a rotation and a translation"):
        map_parts.moved(room(), T, "moved")


def test_a_map_is_not_moved_to_where_its_mesh_loses_its_shape() -> None:
    far = frames.transform(rotations.from_yaw(0.0), [500_000.0, 5_400_000.0, 0.0])
    with pytest.raises(InputError, match="5,400 km from the origin, at most 10 km"):
        map_parts.moved(room(), far, "to a national grid")


def test_a_cropped_map_keeps_what_is_inside_and_nothing_else() -> None:
    kept = Sphere((3.0, 3.0, 1.0), 1.2)
    new = map_parts.cropped(room(), kept, "cropped")
    known = new.field.grid.centre(np.argwhere(new.field.state != esdf.UNKNOWN))
    assert (kept.distance(known) <= 0.0).all()
    inside = GRID.centre(np.argwhere(room().field.state == esdf.FREE))
    assert (new.field.state == esdf.FREE).sum() == (kept.distance(inside) <= 0.0).sum()
    assert (kept.distance(new.known.points_world_m) <= 0.0).all()
    assert (kept.distance(new.vertices_world_m) <= 0.0).all()
    assert new.faces.max() == len(new.vertices_world_m) - 1
    assert new.images == ("b.png",)
    assert new.edits == ()  # the kitchen is elsewhere


def test_the_figures_of_a_cropped_map_are_those_of_the_part(tmp_path: Path) -> None:
    whole = room()
    facts = whole.facts | {"images": 9, "images_placed": 8, "path_length_m": 99.0, "reprojection_error_px": 0.3}
    report = facts | {"free_m3": 99.0, "swept_occupied_m3": 1.0, "not_placed": ["a.png", "d.png"], "points": 99}
    report |= {"unplaced_runs": [{"first": "d.png"}], "placed_by_motion": ["rgb/a.png", "rgb/c.png"]}
    whole = dataclasses.replace(whole, facts=facts, report=report)
    new = map_parts.cropped(whole, Box((2.0, 0.0, 0.0), (6.0, 4.0, 2.4)), "cropped")
    assert (new.images, new.facts["images"], new.facts["images_placed"]) == (("b.png", "c.png"), 2, 2)
    assert new.facts["path_length_m"] == pytest.approx(5.0**0.5)
    assert new.facts["reprojection_error_px"] == 0.3
    assert new.report is not None
    assert new.report["free_m3"] == pytest.approx(1e-3 * (new.field.state == esdf.FREE).sum())
    assert (new.report["points"], new.report["not_placed"]) == (len(new.known.points_world_m), [])
    assert new.report["placed_by_motion"] == ["rgb/c.png"]
    assert "swept_occupied_m3" not in new.report
    assert "unplaced_runs" not in new.report
    assert new.report[map_parts.MADE_OF] == "room"
    apart = map_parts.cropped(whole, Box((-1.0, 0.0, 0.0), (6.0, 2.6, 2.4)), "cropped")
    assert apart.images == ("a.png", "c.png")
    assert apart.facts["path_length_m"] == 0.0  # the image between them is elsewhere
    assert apart.facts["images_placed"] == 1
    map_parts.write(tmp_path / "part", new)
    again = map_parts.read(tmp_path / "part")
    assert again.report is not None
    assert again.report["images"] == 2
    twice = map_parts.cropped(again, Box((2.0, 0.0, 0.0), (5.9, 4.0, 2.4)), "again")
    assert twice.report is not None
    assert twice.report[map_parts.MADE_OF] == "room"


@pytest.mark.parametrize(
    ("kept", "said"),
    [
        (Sphere((30.0, 0.0, 0.0), 1.0), "touches no voxel"),
        (Sphere((3.0, 2.0, 1.0), 0.001), "nothing is known inside"),
        (Sphere((4.5, 2.5, 1.2), 0.5), "no surface of the map lies inside"),
    ],
)
def test_a_crop_that_leaves_nothing_is_refused(kept: Sphere, said: str) -> None:
    with pytest.raises(InputError, match=said):
        map_parts.cropped(room(), kept, "cropped")


def test_two_halves_are_registered_and_joined() -> None:
    """Truth: the second half lies elsewhere, turned by 40 degrees and leaning by one."""
    T = rigid()
    first, second = half(room("west"), -1.0, 4.0), half(room("east", seed=1), 2.0, 7.0)
    second = dataclasses.replace(map_parts.moved(dataclasses.replace(second, edits=()), frames.invert(T), "moved"))
    found = merging.register(first, second)
    np.testing.assert_allclose(found.T_first_second, T, atol=0.01)
    assert found.scale == pytest.approx(1.0, abs=0.005)
    assert found.contradiction < 0.02
    new = merging.merged(first, second, found)
    free = new.field.grid.centre(np.argwhere(new.field.state == esdf.FREE))
    assert (ROOM.distance(free) > 0.0).all()
    assert free[:, 0].min() < 0.2
    assert free[:, 0].max() > 5.7
    assert len(new.known.points_world_m) < 1.1 * len(room().known.points_world_m)  # common ones are there once
    assert np.abs(ROOM.distance(new.vertices_world_m)).max() < 0.02
    assert len(new.images) == len(new.T_world_body) == len(set(new.images))


def test_a_registration_that_is_off_by_its_residual_opens_no_space() -> None:
    first, second = half(room("west"), -1.0, 3.0), half(room("east", seed=1), 2.8, 7.0)
    for off_m in ([0.007, 0.0, 0.0], [0.0, -0.007, 0.0], [0.0, 0.0, 0.007], [-0.004, 0.004, -0.004]):
        T = frames.transform(rotations.from_yaw(0.0), off_m)
        found = merging.Registration(T, np.zeros((0, 2), int), 0, 0.0036, 1.0, 0.1, 0.0)
        new = merging.merged(first, second, found).field
        own = new.grid.centre(np.argwhere(new.state == esdf.FREE))
        own = own[own[:, 0] > 3.1]  # of the second map alone
        corners = own[:, None] + 0.05 * (2.0 * np.array(list(np.ndindex(2, 2, 2))) - 1.0)
        assert len(own) > 5000
        assert (ROOM.distance(corners.reshape(-1, 3)) > -1e-9).all()


def test_edits_of_both_are_in_the_joined_map(tmp_path: Path) -> None:
    first, second = room("first"), room("second", seed=1)
    new = merging.merged(first, second, merging.register(first, second))
    assert [edit.name for edit in new.edits] == ["kitchen", "second: kitchen"]
    map_parts.write(tmp_path / "map", new)
    opened = mapping.open_map(tmp_path / "map")
    assert opened.field.distance([[5.0, 1.0, 1.0]])[0] < 0.0
    assert opened.images == ("a.png", "b.png", "c.png", "second/a.png", "second/b.png", "second/c.png")


def test_the_verdict_of_a_joined_map_is_the_worse_one() -> None:
    first, second = room("first"), room("second", seed=1)
    doubtful = dataclasses.replace(second, facts=second.facts | {"verdict": "doubtful", "reasons": ["too dark"]})
    new = merging.merged(first, doubtful, merging.register(first, doubtful))
    assert (new.facts["verdict"], new.facts["reasons"]) == ("doubtful", ["second: too dark"])
    unjudged = dataclasses.replace(first, facts={"carrier_radius_m": 0.2})
    new = merging.merged(unjudged, doubtful, merging.register(unjudged, doubtful))
    assert new.facts["verdict"] == "doubtful"  # of which planning asks; of the other it only says so


def test_images_keep_different_names_however_often_maps_are_joined() -> None:
    first, second = room("first"), room("second", seed=1)
    once = dataclasses.replace(first, images=("a.png", "second/a.png", "second-2/a.png"))
    new = merging.merged(once, second, merging.register(first, second))
    assert len(set(new.images)) == len(new.images) == 6
    assert new.images[3:] == ("second-3/a.png", "second-3/b.png", "second-3/c.png")


def test_poses_of_another_rig_are_left_out() -> None:
    """What an image resolves is worked out from the map's camera file, which is the first map's."""
    narrow = rigs.Rig((rigs.forward_camera("SIMPLE_RADIAL_FISHEYE", 160, 120, [120.0, 80.0, 60.0, 0.0]),))
    first, second = room("first"), dataclasses.replace(room("second", seed=1), rig=narrow)
    new = merging.merged(first, second, merging.register(first, second))
    assert new.images == first.images
    assert len(new.T_world_body) == len(new.time_s) == 3
    assert "without the poses of second" in new.facts["history"][-1]


def test_what_one_pilot_freed_is_occupied_where_the_other_map_shows_something() -> None:
    """A crate came after the first map, whose pilot had removed a blob there, and closed and opened the kitchen."""
    place = Sphere((4.0, 2.5, 1.2), 0.3)
    with_crate = Scene((*ROOM.solids, Box((3.8, 2.3, 1.0), (4.2, 2.7, 1.4))))
    edits = (
        Edit("remove", place),
        Edit("add", ZONE.solid),
        Edit("clear", ZONE.solid),
        Edit("remove", ZONE.solid),
        ZONE,
    )
    first, second = dataclasses.replace(room("first"), edits=edits), room("second", seed=1)
    second = dataclasses.replace(second, field=esdf.build(esdf.rasterize(with_crate, GRID), GRID))
    new = merging.merged(first, second, merging.register(first, second))
    assert [(edit.action, edit.name) for edit in new.edits] == [("no-fly", "kitchen"), ("no-fly", "second: kitchen")]
    crate = new.field.grid.index(np.array([[4.0, 2.5, 1.2], [5.0, 1.0, 1.0]]))
    assert new.field.state[tuple(crate.T)].tolist() == [esdf.OCCUPIED, esdf.FREE]


def test_what_images_resolve_goes_along_with_a_map(tmp_path: Path) -> None:
    given, points = room(), GRID.centre(np.argwhere(room().field.state == esdf.FREE))
    resolved = given.seen.finest(points)
    assert 0.3 < np.isfinite(resolved).mean() < 1.0
    T = frames.transform(rotations.from_yaw(0.0), [2.0, -3.0, 0.4])
    shifted = map_parts.moved(given, T, "moved").seen.finest(frames.apply(T, points))
    np.testing.assert_array_equal(shifted, resolved)
    new = map_parts.moved(given, rigid(), "moved").seen
    middles = frames.apply(frames.invert(rigid()), new.grid.centres().reshape(-1, 3))
    at_middles = given.seen.finest(middles)
    assert (new.finest_m.ravel() >= at_middles.astype(np.float32)).all()
    np.testing.assert_array_equal(np.isfinite(new.finest_m.ravel()), np.isfinite(at_middles))
    kept = Box((-1.0, -1.0, -1.0), (7.0, 5.0, 0.9))  # without any of the poses
    map_parts.write(tmp_path / "map", map_parts.cropped(given, kept, "cropped"))
    inside = points[kept.distance(points) <= 0.0]
    np.testing.assert_array_equal(
        mapping.open_map(tmp_path / "map").visibility().finest(inside), given.seen.finest(inside)
    )
    corner = Box((2.3, 1.1, 0.5), (7.0, 5.0, 2.2))  # its lowest voxel is not the first of a cell of the mask
    map_parts.write(tmp_path / "corner", map_parts.cropped(given, corner, "cropped"))
    inside = points[corner.distance(points) <= 0.0]
    np.testing.assert_array_equal(
        mapping.open_map(tmp_path / "corner").visibility().finest(inside), given.seen.finest(inside)
    )
    assert mapping.open_map(tmp_path / "corner").free_space() is not None


def test_images_resolve_nothing_in_a_joined_map_where_their_own_was_unknown() -> None:
    """The first map's images look at what only the second map freed, from farther away."""
    first, second = room("first"), room("second", seed=1)
    state = first.field.state.copy()
    hidden = Box((3.5, 0.2, 0.2), (5.8, 3.8, 2.2))
    state[hidden.distance(GRID.centres().reshape(-1, 3)).reshape(GRID.shape) <= 0.0] = esdf.UNKNOWN
    first = dataclasses.replace(first, field=esdf.build(state, GRID))
    coarse = dataclasses.replace(second.seen, finest_m=np.full_like(second.seen.finest_m, 0.5))
    second = dataclasses.replace(second, seen=coarse)
    new = merging.merged(first, second, merging.register(first, second))
    free = new.field.grid.centre(np.argwhere(new.field.state == esdf.FREE))
    behind = hidden.distance(free) < -0.1
    assert behind.sum() > 1000
    assert (new.seen.finest(free[behind]) >= 0.5).all()
    assert (new.seen.finest(free[first.seen.finest(free) < 0.3]) < 0.5).any()


@pytest.mark.parametrize(
    ("radii_m", "sources", "radius_m", "standing"),
    [
        ((0.2, 0.4), ("rig baseline", "given length"), 0.2, Standing.GOOD),
        ((0.2, None), ("rig baseline", "depth images"), 0.2, Standing.GOOD),
        ((0.2, None), ("rig baseline", "given length"), None, Standing.DOUBTFUL),
        ((None, None), ("rig baseline", None), None, Standing.DOUBTFUL),
        ((None, None), ("depth images", "depth images"), None, Standing.GOOD),
        ((None, None), (None, None), None, Standing.GOOD),
    ],
)
def test_the_free_space_of_a_joined_map_is_as_trusted_as_that_of_the_worse_part(
    tmp_path: Path, radii_m: tuple, sources: tuple, radius_m: float | None, standing: Standing
) -> None:
    parts = []
    for seed, (radius, source) in enumerate(zip(radii_m, sources, strict=True)):
        given = {"verdict": "good", "carrier_radius_m": radius, "scale_source": source}
        facts = {name: value for name, value in given.items() if value is not None}
        parts.append(dataclasses.replace(room(f"part{seed}", seed=seed), facts=facts))
    first, second = parts
    new = merging.merged(first, second, merging.register(first, second))
    assert new.facts.get("carrier_radius_m") == radius_m
    map_parts.write(tmp_path / "map", new)
    assert mapping.open_map(tmp_path / "map").standing is standing


def test_maps_without_overlap_are_refused() -> None:
    with pytest.raises(MapError, match="too little in common"):
        merging.register(half(room("west"), -1.0, 2.0), half(room("east", seed=1), 4.0, 7.0))


def test_maps_of_another_scale_are_refused() -> None:
    larger = room("larger", seed=1)
    known = dataclasses.replace(larger.known, points_world_m=1.09 * larger.known.points_world_m)
    with pytest.raises(MapError, match=r"larger is 1\.09. times as large as room"):
        merging.register(room(), dataclasses.replace(larger, known=known))


def test_maps_that_contradict_each_other_are_refused() -> None:
    """The same points, but the second map's surfaces run through the first one's free space."""
    walls = [Box((x, 0.2, 0.2), (x + 0.1, 3.8, 2.2)) for x in (0.9, 3.2, 4.1, 5.2)]
    other = dataclasses.replace(
        room("other", seed=1), vertices_world_m=surface(Scene(walls), 6000)[: len(room().vertices_world_m)]
    )
    with pytest.raises(MapError, match="lie in the other's free space"):
        merging.register(room(), other)


def test_inferred_walls_go_along_with_a_map_that_is_written_and_cropped(tmp_path: Path) -> None:
    whole = room()
    state = whole.field.state.copy()
    state[20:50, 30:34] = esdf.UNKNOWN
    marked = (state == esdf.UNKNOWN) & (GRID.centres()[..., 0] > 3.0)
    whole = dataclasses.replace(whole, field=esdf.build(state, GRID), inferred=marked)
    map_parts.write(tmp_path / "whole", whole)
    np.testing.assert_array_equal(map_parts.read(tmp_path / "whole").inferred, marked)
    part = half(whole, 2.0, 4.0)
    places = GRID.index(part.field.grid.centre(np.argwhere(part.inferred)))
    assert len(places)
    assert marked[tuple(places.T)].all()
    (tmp_path / "whole" / "inferred.npz").unlink()
    assert not mapping.open_map(tmp_path / "whole").inferred().any()


def test_the_confidence_of_the_surface_goes_along_with_its_vertices(tmp_path: Path) -> None:
    whole = room()
    figures = dict.fromkeys(confidence.FIGURES, 9.0)
    whole = dataclasses.replace(whole, facts=whole.facts | figures, report=figures)

    def known(parts: MapParts) -> dict[tuple[float, ...], tuple[float, int]]:
        """By the place of each vertex."""
        pairs = zip(parts.confidence.deviation_m.tolist(), parts.confidence.images.tolist(), strict=True)
        return dict(zip(map(tuple, np.round(parts.vertices_world_m, 4).tolist()), pairs, strict=True))

    map_parts.write(tmp_path / "whole", whole)
    back = map_parts.read(tmp_path / "whole").confidence
    np.testing.assert_array_equal(back.deviation_m, whole.confidence.deviation_m)
    np.testing.assert_array_equal(back.images, whole.confidence.images)
    part = half(whole, 2.0, 4.0)
    assert 0 < len(known(part)) < len(known(whole))
    assert known(part).items() <= known(whole).items()
    assert part.report is not None
    for stated in (part.facts, part.report):
        assert stated.items() >= confidence.figures(part.confidence, 0.1).items()
    turned = map_parts.moved(whole, rigid(), "moved")
    np.testing.assert_array_equal(turned.confidence.deviation_m, whole.confidence.deviation_m)
    first, second = half(room("west"), -1.0, 4.0), half(room("east", seed=1), 2.0, 7.0)
    new = merging.merged(first, second, merging.Registration(np.eye(4), np.zeros((0, 2), int), 0, 0.001, 1.0, 0.1, 0.0))
    assert len(known(new)) > len(known(first))
    assert known(new).items() <= (known(second) | known(first)).items()
    assert new.facts.items() >= confidence.figures(new.confidence, 0.1).items()


def test_a_map_without_confidence_states_none_of_its_parts(tmp_path: Path) -> None:
    whole = room()
    figures = dict.fromkeys(confidence.FIGURES, 9.0)
    map_parts.write(tmp_path / "map", dataclasses.replace(whole, facts=whole.facts | figures, report=figures))
    (tmp_path / "map" / "confidence.npz").unlink()
    surface = mapping.open_map(tmp_path / "map").surface()
    assert surface is not None
    assert np.isnan(surface.confidence.deviation_m).all()
    part = half(map_parts.read(tmp_path / "map"), 2.0, 4.0)
    assert part.report is not None
    assert not {*part.facts, *part.report} & {*confidence.FIGURES}
