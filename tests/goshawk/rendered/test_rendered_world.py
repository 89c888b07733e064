"""The renderer agrees with geometry: rays end on surfaces, pixels look where the lens says, images are repeatable."""

from pathlib import Path

import numpy as np
import pytest

from esdf.solids import Box, Capsule, Cylinder, Room, Sphere
from flight import InputError
from goshawk.rendered import disturbed, hall
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from goshawk.rendered.scene import RenderedScene
from goshawk.rendered.world import RenderedFlight
from mapping.camera import rig as rigs

SCENE = rendered_room.furnished()
RIG = rendered_world.default_rig(0.25)
FLIGHT = rendered_world.loop_flight(60)


def unit_rays(count: int, seed: int) -> np.ndarray:
    rays = np.random.default_rng(seed).normal(size=(count, 3))
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


@pytest.mark.parametrize("index", [0, 13, 31, 47])
def test_rays_end_on_the_surface_and_cross_only_air(index: int) -> None:
    origin, rays = FLIGHT.T_world_body[index, :3, 3], unit_rays(20_000, index)
    ranges = rendered_world.cast_rays(SCENE, origin, rays)
    assert np.abs(SCENE.distance(origin + ranges[:, None] * rays)).max() < 1e-9
    for share in (0.2, 0.6, 0.95):
        assert SCENE.distance(origin + share * ranges[:, None] * rays).min() > 0.0


@pytest.mark.parametrize(
    "solid",
    [
        Box((-0.2, -0.7, -0.7), (0.8, 0.3, 0.9)),
        Room((-0.2, -0.7, -0.7), (0.8, 0.3, 0.9)),
        Sphere((0.3, -0.2, 0.1), 0.5),
        Cylinder((0.3, -0.2, 0.1), 0.5, 1.6),
    ],
    ids=lambda solid: type(solid).__name__,
)
def test_each_solid_is_met_where_its_distance_vanishes(solid: Box | Room | Sphere | Cylinder) -> None:
    scene = RenderedScene(((solid, "wood"),))
    inside = isinstance(solid, Room)
    origin = np.array([0.35, -0.1, 0.2]) if inside else np.array([2.0, 1.5, -1.8])
    rays = unit_rays(20_000, 4)
    ranges = rendered_world.cast_rays(scene, origin, rays)
    met = np.isfinite(ranges)
    assert met.all() if inside else 100 < met.sum() < 10_000
    assert np.abs(scene.distance(origin + ranges[met, None] * rays[met])).max() < 1e-9
    # a ray that meets nothing stays outside all along
    for along in np.linspace(0.0, 5.0, 40):
        assert met.all() or scene.distance(origin + along * rays[~met]).min() > -1e-9


def test_a_solid_the_renderer_cannot_draw_is_refused() -> None:
    scene = RenderedScene(((Capsule((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.1), "wood"),))
    with pytest.raises(InputError, match="cannot draw Capsule"):
        scene.solid_table()


def test_pixels_show_the_point_that_the_lens_projects_there() -> None:
    """A single bright ball in the dark appears around the projection of its centre."""
    camera = rendered_world.default_rig()["front"]
    for direction in ([1.0, 0.0, 0.0], [1.0, 0.8, 0.3], [1.0, -0.9, -0.5], [0.6, 1.0, 0.2]):
        centre = 2.0 * np.array(direction) / np.linalg.norm(direction)
        ball = Sphere((centre[0], centre[1], centre[2]), 0.05)
        image = rendered_world.render(camera, np.eye(4), scene=RenderedScene(((ball, "metal"),)), seed=0, noise=0.0)
        T = camera.T_body_camera
        expected = camera.project((centre - T[:3, 3]) @ T[:3, :3])
        rows, columns = np.nonzero(image)
        np.testing.assert_allclose([columns.mean() + 0.5, rows.mean() + 0.5], expected, atol=0.6)


def test_the_same_seed_gives_the_same_picture_and_another_one_other_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    def picture(seed: int) -> np.ndarray:
        return rendered_world.render(RIG["down"], FLIGHT.T_world_body[5], scene=SCENE, seed=seed)

    first = picture(3)
    monkeypatch.setattr(rendered_world, "THREADS", 1)
    np.testing.assert_array_equal(picture(3), first)
    difference = picture(4).astype(int) - first
    # two independent draws of about 1.6 to 3 grey levels each
    assert 2.0 < difference.std() < 6.0
    assert abs(difference.mean()) < 0.1


def test_nothing_is_seen_outside_the_field_of_view() -> None:
    whole = RIG["front"]
    narrow = rigs.Camera("n", "n", whole.model, whole.width, whole.height, whole.params, whole.T_body_camera, 1.5)
    image = rendered_world.render(narrow, FLIGHT.T_world_body[0], scene=SCENE, seed=0)
    assert (image[~narrow.lit()] == 0).all()
    assert (image[narrow.lit()] > 0).mean() > 0.99


def test_the_flight_weaves_clear_of_the_furniture_through_both_doorways() -> None:
    positions = rendered_world.loop_flight(600).T_world_body[:, :3, 3]
    assert SCENE.distance(positions).min() > 0.5
    crossings = positions[1:][np.diff(np.sign(positions[:, 0])) != 0]
    assert {round(float(y)) for y in crossings[:, 1]} == {-2, 2}
    steps = np.linalg.norm(np.diff(FLIGHT.T_world_body[:, :3, 3], axis=0), axis=1)
    assert steps.max() < 1.02 * steps.min()


def test_a_written_sequence_has_equal_names_per_instant_and_its_truth_apart(tmp_path: Path) -> None:
    flight = rendered_world.loop_flight(3, share=0.05)
    folder = rendered_world.write_rendered_sequence(tmp_path / "flight", rig=RIG, flight=flight)
    names = [sorted(p.name for p in (folder / camera).iterdir()) for camera in ("front", "down")]
    assert names == [["0000.png", "0001.png", "0002.png"]] * 2
    assert sorted(p.name for p in folder.iterdir()) == [
        "camera.toml",
        "down",
        "front",
        "references.csv",
        "times.csv",
        "truth",
    ]
    read = rigs.load(folder / "camera.toml")
    np.testing.assert_allclose(read["down"].T_body_camera, RIG["down"].T_body_camera, atol=1e-12)
    poses = np.loadtxt(folder / "truth" / "poses.csv", delimiter=",", skiprows=1, usecols=range(1, 9))
    np.testing.assert_allclose(poses[:, 0], flight.times_s)
    np.testing.assert_allclose(poses[:, 1:4], flight.T_world_body[:, :3, 3], atol=1e-8)


def test_an_impossible_flight_is_refused() -> None:
    with pytest.raises(InputError, match="at least 2"):
        rendered_world.loop_flight(1)


def test_the_hall_is_flown_clear_of_what_stands_in_it() -> None:
    flown = rendered_world.loop_flight(200, through_world_m=hall.LOOP_WORLD_M)
    assert hall.furnished().distance(flown.T_world_body[:, :3, 3]).min() > 0.5


def test_crates_move_within_a_flight_and_again_before_a_later_one() -> None:
    T = rendered_world.loop_flight(20).T_world_body[[5, 5]]
    flown, rig = RenderedFlight(np.arange(2.0), T), rendered_world.default_rig(0.1)
    meanwhile, later = (disturbed.pictures(rig, flown, 1, is_later=is_later) for is_later in (False, True))
    for instant in (0, 1):  # the same noise and exposure, so what differs is what moved
        assert (meanwhile(instant, 0) != later(instant, 0)).mean() > 0.01
    for moved, (crates, *_) in enumerate(disturbed.CRATES_WORLD_M):
        inside = [[*(np.array(crates) + 0.1), 0.3]]
        assert [disturbed.scene(k).distance(inside)[0] < 0.0 for k in range(3)] == [k == moved for k in range(3)]


def test_blur_spreads_what_is_seen_about_its_place() -> None:
    """A filter of even width moves it by half a pixel, which no motion of the rig explains."""
    point = np.zeros((5, 41), np.uint8)
    point[2, 20] = 180
    rows, columns = np.nonzero(blurred := disturbed.blurred(point))
    assert (set(rows), len(columns)) == ({2}, disturbed.BLUR_PX)
    assert np.average(columns, weights=blurred[rows, columns]) == pytest.approx(20.0)
