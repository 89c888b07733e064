"""The textured mesh against the paint of a rendered wall, with planted exposures and a pillar that hides some of it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import esdf
import mapping
from esdf.solids import Box, Room
from flight import FloatArray, FormatError, InputError, frames, rotations
from goshawk import _rendering
from goshawk.cli import main
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from goshawk.rendered.scene import RenderedScene
from mapping import given_paths, map_parts, texturing
from mapping.camera import rig as rigs
from mapping.camera.rig import Rig
from mapping.dense import atlas, confidence, exposure, mesh_file, resolution, texture
from mapping.dense.atlas import FlattenedMesh
from mapping.dense.exposure import Brightness
from mapping.dense.texture import TextureView
from mapping.map_parts import MapParts
from mapping.sparse.localization_map import LocalizationMap

CELL_M = 0.04
"""Edge of a chequer: four pixels of the images, and less than the 5 cm between vertices."""
WALL_X_M, VOXEL_M = 2.0, 0.05
LOW, HIGH = (-2.0, -1.5, 0.0), (WALL_X_M, 1.5, 2.4)
CHEQUERS = [
    Box((1.99, -0.4 + CELL_M * i, 1.0 + CELL_M * j), (WALL_X_M, -0.4 + CELL_M * (i + 1), 1.0 + CELL_M * (j + 1)))
    for i in range(12)
    for j in range(10)
    if (i + j) % 2 == 0
]
PAPER = Box((1.995, -0.5, 0.9), (WALL_X_M, 0.18, 1.5))
PILLAR = Box((1.2, 0.5, 0.0), (1.35, 0.65, 2.4))
SCENE = RenderedScene(
    ((Room(LOW, HIGH), "plaster"), (PILLAR, "paper"), (PAPER, "paper"), *((box, "ink") for box in CHEQUERS))
)
RIG = Rig((rendered_world.default_rig(0.5)["front"],))
GAINS = np.array([1.0, 0.7, 1.25, 0.8, 1.1, 0.65, 1.3, 0.9, 1.2])
"""Planted: exposure jumps from image to image."""
RED, BLUE = np.array([1.0, 0.6, 0.3]), np.array([0.4, 0.7, 1.0])
"""Tints of the wall in colour images."""
AT_M = [(x, y, 1.2) for x in (0.2, 0.5, 0.8) for y in (-0.7, 0.0, 0.9)]
T_WORLD_BODY = frames.transform(rotations.from_yaw([-0.2 * y for _, y, _ in AT_M]), AT_M)


def picture(number: int, camera: rigs.Camera = RIG.cameras[0]) -> NDArray[np.uint8]:
    gain = rendered_world.GAIN * GAINS[number]
    return rendered_world.render(camera, T_WORLD_BODY[number], scene=SCENE, seed=number, gain=gain)


def reader(pixels: NDArray[np.uint8]) -> Callable[[], tuple[NDArray[np.uint8], None]]:
    return lambda: (pixels, None)


@pytest.fixture(scope="module")
def pictures() -> list[NDArray[np.uint8]]:
    return [picture(number) for number in range(len(GAINS))]


@pytest.fixture(scope="module")
def views(pictures: list[NDArray[np.uint8]]) -> list[TextureView]:
    camera = RIG.cameras[0]
    poses = T_WORLD_BODY @ camera.T_body_camera
    return [TextureView(f"{k}", camera, T, reader(p)) for k, (T, p) in enumerate(zip(poses, pictures, strict=True))]


def true_colours(T_world_camera: FloatArray, rays: FloatArray) -> NDArray[np.uint8]:
    """What a camera without noise, vignetting and exposure jumps sees along rays (h, w, 3)."""
    tables = SCENE.solid_table(), SCENE.material_table(), rendered_room.LAMPS_WORLD_M
    return _rendering.render(*tables, np.ascontiguousarray(rays), T_world_camera, rendered_world.GAIN, 0.0, 0.0, 0, 2)


def wall_and_pillar() -> tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8]]:
    """A 5 cm mesh of wall and pillar as a map has it, with the true paint at each vertex."""
    y, z = np.meshgrid(np.arange(-1.45, 1.46, VOXEL_M), np.arange(0.05, 2.36, VOXEL_M), indexing="ij")
    number = np.arange(y.size).reshape(y.shape)
    a, b, c, d = (n.ravel() for n in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    wall = np.stack([np.full(y.size, WALL_X_M), y.ravel(), z.ravel()], axis=1)
    faces = np.concatenate([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)])
    pillar: Any = trimesh.creation.box(bounds=[PILLAR.low_world_m, PILLAR.high_world_m]).subdivide_to_size(0.3)
    vertices = np.concatenate([wall, pillar.vertices])
    directions = np.column_stack([np.zeros(len(vertices)), np.zeros(len(vertices)), np.ones(len(vertices))])
    colours = np.empty(len(vertices), np.uint8)
    for k, vertex in enumerate(vertices):  # from 10 cm before each vertex, on the room's side of it
        T = look_along_x(vertex - [0.1, 0.0, 0.0])
        colours[k] = true_colours(T, directions[k].reshape(1, 1, 3))[0, 0]
    return (
        vertices,
        np.concatenate([faces, pillar.faces + len(wall)]).astype(np.int32),
        np.repeat(colours[:, None], 3, 1),
    )


def look_along_x(at_m: FloatArray) -> FloatArray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rigs.R_BODY_CAMERA_FORWARD, at_m
    return T


@pytest.fixture(scope="module")
def mesh() -> tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8]]:
    return wall_and_pillar()


@pytest.fixture(scope="module")
def flat(mesh: tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8]]) -> FlattenedMesh:
    return atlas.flatten(mesh[0], mesh[1], most_faces=1500, size=512)


@pytest.fixture(scope="module")
def painted(
    mesh: tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8]], flat: FlattenedMesh, views: list[TextureView]
) -> texture.Texture:
    return texture.paint(flat, nearest_colours(mesh, flat), views, size=512, tolerance_m=VOXEL_M)


def nearest_colours(
    mesh: tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8]], flat: FlattenedMesh
) -> NDArray[np.uint8]:
    apart = np.linalg.norm(mesh[0][:, None] - flat.vertices_world_m[None], axis=2)
    return mesh[2][apart.argmin(axis=0)]


def hits(vertices: FloatArray, faces: NDArray[np.int32], points_m: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Face and barycentric coordinates of the mesh at points (n, 3) of the wall, met along x."""
    import open3d

    scene, tensor = open3d.t.geometry.RaycastingScene(), cast(Any, open3d.core.Tensor)
    scene.add_triangles(tensor(vertices.astype(np.float32)), tensor(faces.astype(np.uint32)))
    rays = np.column_stack([points_m - [0.2, 0.0, 0.0], np.broadcast_to([1.0, 0.0, 0.0], points_m.shape)])
    hit = scene.cast_rays(tensor(rays.astype(np.float32)))
    second, third = hit["primitive_uvs"].numpy().T
    return hit["primitive_ids"].numpy().astype(np.int64), np.stack([1.0 - second - third, second, third], axis=1)


def patch(low_y: float, high_y: float, low_z: float, high_z: float) -> tuple[FloatArray, FloatArray]:
    """Points (n, 3) of the wall, 5 mm apart, and their true brightness (n,)."""
    y, z = np.meshgrid(np.arange(low_y, high_y, 0.005), np.arange(low_z, high_z, 0.005))
    points = np.stack([np.full(y.size, WALL_X_M), y.ravel(), z.ravel()], axis=1)
    centre = look_along_x(np.array([1.5, 0.5 * (low_y + high_y), 0.5 * (low_z + high_z)]))
    towards = points - centre[:3, 3]
    rays = (towards / np.linalg.norm(towards, axis=1, keepdims=True)) @ centre[:3, :3]
    return points, true_colours(centre, rays[None])[0].astype(float)


def textured(flat: FlattenedMesh, painted: texture.Texture, points_m: FloatArray, channel: int = 0) -> FloatArray:
    face, share = hits(flat.vertices_world_m, flat.faces, points_m)
    uv = np.einsum("nk,nkc->nc", share, flat.corners_uv[face]) * len(painted.pixels)
    column, row = np.clip(uv.astype(int), 0, len(painted.pixels) - 1).T
    return painted.pixels[row, column, channel].astype(float)


def with_vertex_colours(
    mesh: tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8]], points_m: FloatArray
) -> FloatArray:
    face, share = hits(mesh[0], mesh[1], points_m)
    return (share * mesh[2][mesh[1][face], 0]).sum(axis=1)


def evened_error(found: FloatArray, truth: FloatArray) -> float:
    """Mean error in grey levels after the one brightness that all share is taken out."""
    return float(np.abs(found * np.median(truth / np.maximum(found, 1.0)) - truth).mean())


def test_every_texel_lies_where_its_face_says(flat: FlattenedMesh) -> None:
    shown = atlas.texels(flat, 512)
    uv = np.einsum("nk,nkc->nc", shown.share, flat.corners_uv[shown.face])
    np.testing.assert_allclose(512 * uv, np.stack([shown.column, shown.row], axis=1) + 0.5, atol=0.1)  # of a texel
    assert len(flat.faces) <= 1500
    assert len(np.unique(shown.face)) > 0.99 * len(flat.faces)  # a sliver may be thinner than a texel


def test_a_mesh_split_at_its_seams_has_the_same_corners(flat: FlattenedMesh) -> None:
    vertices, faces, uv = atlas.seams_split(flat)
    np.testing.assert_array_equal(vertices[faces], flat.vertices_world_m[flat.faces])
    np.testing.assert_array_equal(uv[faces], flat.corners_uv)


def test_planted_exposures_and_vignetting_are_recovered_in_spite_of_highlights() -> None:
    rng = np.random.default_rng(4)
    camera, log_gain = [0, 1] * 6, rng.normal(0.0, 0.3, 12)
    falloff = np.array([[-0.4, 0.1], [-0.1, -0.2]])
    image, point = (n.ravel() for n in np.meshgrid(np.arange(12), np.arange(200)))
    angle = rng.uniform(0.0, 0.9, len(image))
    powers = np.stack([angle**2, angle**4], axis=1)
    log = rng.normal(4.5, 0.5, 200)[point] + log_gain[image] + (powers * falloff[np.array(camera)[image]]).sum(axis=1)
    log += rng.normal(0.0, 0.02, len(log)) + 1.0 * (rng.random(len(log)) < 0.05)
    found = exposure.solve(Brightness(image, point, log, angle), camera)
    np.testing.assert_allclose(found.log_gain, log_gain - log_gain.mean(), atol=0.03)
    grid = np.linspace(0.0, 0.9, 10)
    for image in (0, 1):
        truth = np.exp(log_gain[image] - log_gain.mean() + falloff[image, 0] * grid**2 + falloff[image, 1] * grid**4)
        np.testing.assert_allclose(found.gain(image, grid), truth, rtol=0.04)


def test_an_image_that_shares_no_point_keeps_its_exposure() -> None:
    seen = Brightness(np.array([0, 1, 2]), np.array([0, 0, 1]), np.array([4.0, 4.4, 1.0]), np.zeros(3))
    found = exposure.solve(seen, [0, 0, 0]).log_gain
    assert found[1] - found[0] == pytest.approx(0.4, abs=0.02)
    assert found[2] == pytest.approx(found[:2].mean(), abs=0.02)


def test_planted_exposure_jumps_are_evened(painted: texture.Texture) -> None:
    planted = np.log(GAINS) - np.log(GAINS).mean()
    np.testing.assert_allclose(painted.exposure.log_gain, planted, atol=0.03)
    assert painted.left_out == ()
    assert painted.painted > 0.9


def test_the_texture_is_nearer_to_the_true_paint_than_vertex_colours(
    mesh: tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8]], flat: FlattenedMesh, painted: texture.Texture
) -> None:
    for part in ((-0.4, 0.08, 1.0, 1.4), (-1.2, -0.6, 0.6, 1.8), (0.3, 1.2, 0.6, 1.8)):  # the last behind the pillar
        points, truth = patch(*part)
        texture_error = evened_error(textured(flat, painted, points), truth)
        vertex_error = evened_error(with_vertex_colours(mesh, points), truth)
        assert texture_error < 0.6 * vertex_error, part


def test_chequers_of_four_pixels_are_resolved_and_not_by_vertex_colours(
    mesh: tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8]], flat: FlattenedMesh, painted: texture.Texture
) -> None:
    points, truth = patch(-0.4, 0.08, 1.0, 1.4)
    dark = truth < truth.mean()

    def contrast(found: FloatArray) -> float:  # 1: as the true paint; Michelson's, of the means
        def of(levels: FloatArray) -> float:
            return float((levels[~dark].mean() - levels[dark].mean()) / (levels[~dark].mean() + levels[dark].mean()))

        return of(found) / of(truth)

    assert contrast(textured(flat, painted, points)) > 0.6
    assert contrast(with_vertex_colours(mesh, points)) < 0.4


def tinted(view: TextureView) -> NDArray[np.uint8]:
    """The image in colour: red left of y = 0 on the wall (as seen from the room), blue right of it."""
    pixels, _ = view.read()
    camera = view.camera
    rays = camera.unproject(camera.pixel_centres()) @ view.T_world_camera[:3, :3].T
    x, y, _ = view.T_world_camera[:3, 3]
    y_m = y + (WALL_X_M - x) / rays[..., 0] * rays[..., 1]
    tint = np.where((y_m > 0.0)[..., None], RED, BLUE)
    return np.round(pixels[..., None] * tint).astype(np.uint8)


def test_colour_images_paint_each_surface_in_its_colour_and_channels_in_their_order(
    mesh: tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8]], flat: FlattenedMesh, views: list[TextureView]
) -> None:
    coloured = [TextureView(v.name, v.camera, v.T_world_camera, reader(tinted(v))) for v in views]
    red_side = flat.vertices_world_m[:, 1:2] > 0.0
    given = np.round(nearest_colours(mesh, flat) * np.where(red_side, RED, BLUE)).astype(np.uint8)
    found = texture.paint(flat, given, coloured, size=512, tolerance_m=VOXEL_M)
    planted = np.log(GAINS) - np.log(GAINS).mean()
    np.testing.assert_allclose(found.exposure.log_gain, planted, atol=0.05)
    for low_y, high_y, tint in ((0.7, 1.2, RED), (-1.2, -0.6, BLUE)):
        points, _ = patch(low_y, high_y, 0.6, 1.8)
        shares = np.stack([textured(flat, found, points, channel) for channel in range(3)], axis=1)
        shares /= shares.max(axis=1, keepdims=True)
        np.testing.assert_allclose(np.median(shares, axis=0), tint / tint.max(), atol=0.02)


def test_what_a_mask_leaves_out_is_not_painted(
    mesh: tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8]], flat: FlattenedMesh, views: list[TextureView]
) -> None:
    def half_black(view: TextureView) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
        pixels, _ = view.read()
        used = np.ones(pixels.shape, dtype=bool)
        used[120:] = False
        return np.where(used, pixels, 255).astype(np.uint8), used

    masked = [
        TextureView(view.name, view.camera, view.T_world_camera, lambda view=view: half_black(view)) for view in views
    ]
    found = texture.paint(flat, nearest_colours(mesh, flat), masked, size=512, tolerance_m=VOXEL_M)
    points, truth = patch(-1.2, -0.6, 0.6, 1.8)
    assert evened_error(textured(flat, found, points), truth) < 25.0  # vertex colours below, images above: no white


def test_images_of_another_place_are_refused_and_one_of_them_is_left_out(
    mesh: tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8]], flat: FlattenedMesh, views: list[TextureView]
) -> None:
    def turned(view: TextureView) -> TextureView:
        return TextureView(view.name, view.camera, view.T_world_camera, reader(view.read()[0][::-1, ::-1].copy()))

    colours = nearest_colours(mesh, flat)
    one = texture.paint(flat, colours, [turned(views[0]), *views[1:]], size=256, tolerance_m=VOXEL_M)
    assert one.left_out == ("0",)
    with pytest.raises(InputError, match="do not look like the map"):
        texture.paint(flat, colours, [turned(view) for view in views], size=256, tolerance_m=VOXEL_M)


def test_the_file_stands_upright_and_holds_the_texture_as_it_was(tmp_path: Path) -> None:
    vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:32, :32] = [200, 30, 30]  # upper left: u, v below a half
    uv = np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]])
    mesh_file.save_textured(tmp_path / "mesh.glb", vertices, np.array([[0, 1, 2]], np.int32), uv, pixels)
    read: Any = trimesh.load(tmp_path / "mesh.glb", force="mesh", process=False)
    np.testing.assert_allclose(read.vertices, [[0, 0, 0], [1, 0, 0], [0, 2, 0]], atol=1e-6)  # up is y
    colours = read.visual.to_color().vertex_colors[:, :3].astype(float)
    np.testing.assert_allclose(colours, [[200, 30, 30], [0, 0, 0], [0, 0, 0]], atol=12)
    assert b"KHR_materials_unlit" in (tmp_path / "mesh.glb").read_bytes()


@pytest.fixture
def map_with_images(
    tmp_path: Path,
    mesh: tuple[FloatArray, NDArray[np.int32], NDArray[np.uint8]],
    pictures: list[NDArray[np.uint8]],
) -> Path:
    import cv2

    grid = esdf.Grid.covering(LOW, HIGH, VOXEL_M)
    field = esdf.build(esdf.rasterize(SCENE.scene, grid), grid)
    names = tuple(f"{k}.png" for k in range(len(pictures)))
    parts = MapParts(
        name="map",
        field=field,
        edits=(),
        vertices_world_m=mesh[0],
        faces=mesh[1],
        colours=mesh[2],
        confidence=confidence.unknown(len(mesh[0])),
        known=LocalizationMap(np.zeros((0, 3)), np.zeros((0, 128))),
        rig=RIG,
        images=names,
        time_s=np.full(len(names), np.nan),
        T_world_body=T_WORLD_BODY,
        seen=resolution.visibility(field.state, grid, [(c, T @ c.T_body_camera) for T in T_WORLD_BODY for c in RIG]),
        inferred=np.zeros(field.grid.shape, bool),
        facts={"verdict": "good", "reasons": []},
        report=None,
    )
    map_parts.write(tmp_path / "map", parts)
    (tmp_path / "images" / "front").mkdir(parents=True)
    for name, pixels in zip(names, pictures, strict=True):
        cv2.imwrite(str(tmp_path / "images" / "front" / name), pixels)
    return tmp_path / "map"


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return int(ended.value.code or 0)


def test_the_verb_writes_once_and_leaves_map_and_hash_as_they_are(
    map_with_images: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    images, out = map_with_images.parent / "images", map_with_images / texturing.FILE
    hash = mapping.open_map(map_with_images).hash
    small = ("--faces", 400, "--size", 256)
    assert run("map", "texture", map_with_images, *small) == 2
    assert "give --images" in capsys.readouterr().err
    assert run("map", "texture", map_with_images, "--images", images, *small) == 0
    assert run("map", "texture", map_with_images, "--images", images, *small) == 2
    assert "exists" in capsys.readouterr().err
    first = out.read_bytes()
    assert run("map", "texture", map_with_images, "--images", images, "--overwrite", *small) == 0
    assert (map_with_images / f"{texturing.FILE}.old-1").read_bytes() == first
    assert mapping.open_map(map_with_images).hash == hash
    map_parts.write(map_with_images.parent / "copy", map_parts.read(map_with_images))
    assert not (map_with_images.parent / "copy" / texturing.FILE).exists()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (("--images", "gone"), "map's images are not in"),
        (("--images", "map/map.toml"), "made of a video"),
        (("--images", "."), "no sub-folder 'front'"),
        (("--faces", 3), "--faces is 3; it must be from 100"),
        (("--size", 100_000), "--size is 100000; it must be from 256 to 8192"),
    ],
)
def test_what_cannot_be_textured_is_refused_and_nothing_is_written(
    map_with_images: Path,
    given: tuple[object, ...],
    message: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(map_with_images.parent)
    before = sorted(map_with_images.iterdir())
    assert run("map", "texture", "map", "--images", "images", *given) == 2
    assert message in capsys.readouterr().err
    assert sorted(map_with_images.iterdir()) == before


def test_a_map_knows_where_its_images_are_also_when_both_move(map_with_images: Path) -> None:
    facts = given_paths.noted(map_with_images, map_with_images.parent / "images", None)
    assert facts == {"images_from": "../images"}
    toml = map_with_images / "map.toml"
    toml.write_text(toml.read_text() + 'images_from = "../images"\n')
    moved = map_with_images.parent.rename(map_with_images.parent.with_name("elsewhere"))
    assert images_of(moved / "map") == moved / "images"
    map_parts.write(moved / "copies" / "copy", map_parts.read(moved / "map"))
    assert images_of(moved / "copies" / "copy") is None


def images_of(folder: Path) -> Path | None:
    return given_paths.read(folder, mapping.open_map(folder).facts, given_paths.IMAGES)


@pytest.mark.parametrize("entry", [3, "", ["a"]])
def test_an_entry_that_is_no_path_is_named(entry: object, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="images_from is"):
        given_paths.read(tmp_path, {"images_from": entry}, given_paths.IMAGES)
