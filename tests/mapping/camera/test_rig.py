"""Lenses and rigs: projection and its inverse, COLMAP's own numbers, the camera file."""

import numpy as np
import pytest

from flight import FormatError, InputError, frames, rotations
from mapping import _mapping
from mapping.camera import rig as rigs
from mapping.camera.rig import Camera, Rig
from mapping.dense.views import lens_row

KB = [278.0, 279.0, 320.0, 240.0, 0.02, -0.01, 0.004, -0.001]
LENSES = [
    ("SIMPLE_PINHOLE", [400.0, 320.0, 240.0]),
    ("PINHOLE", [400.0, 410.0, 320.0, 240.0]),
    ("SIMPLE_RADIAL_FISHEYE", [374.9, 320.0, 240.0, 0.061]),
    ("RADIAL_FISHEYE", [300.0, 320.0, 240.0, 0.05, -0.01]),
    ("OPENCV_FISHEYE", KB),
    ("SIMPLE_RADIAL", [400.0, 320.0, 240.0, 0.05]),
    ("RADIAL", [400.0, 320.0, 240.0, -0.08, 0.02]),
    ("OPENCV", [400.0, 410.0, 320.0, 240.0, -0.08, 0.02, 0.001, -0.002]),
    ("THIN_PRISM_FISHEYE", [*KB[:4], 0.02, -0.01, 0.001, -0.002, 0.004, -0.001, 0.003, -0.002]),
    (
        "RAD_TAN_THIN_PRISM_FISHEYE",
        [*KB[:4], 0.02, -0.01, 0.004, -0.001, 2e-4, -1e-5, 0.001, -0.002, 0.003, 4e-4, -0.002, 3e-4],
    ),
    ("EUCM", [278.0, 279.0, 320.0, 240.0, 0.63, 1.04]),
]


def lens(model: str, params: list[float], **changes: object) -> Camera:
    return Camera(**{"name": "c", "folder": "c", "model": model, "width": 640, "height": 480,
                     "params": np.array(params), "T_body_camera": np.eye(4)} | changes)  # fmt: skip


@pytest.mark.parametrize(("model", "params"), LENSES)
def test_unproject_inverts_project_everywhere_on_the_image(model: str, params: list[float]) -> None:
    camera = lens(model, params)
    pixels = camera.pixel_centres()[::7, ::7]
    rays = camera.unproject(pixels)
    seen = np.isfinite(rays[..., 0])
    assert seen.mean() > 0.9
    np.testing.assert_allclose(np.linalg.norm(rays[seen], axis=-1), 1.0, atol=1e-12)
    np.testing.assert_allclose(camera.project(3.0 * rays[seen]), pixels[seen], atol=1e-6)


@pytest.mark.parametrize(("model", "params"), LENSES)
def test_projection_agrees_with_colmap(model: str, params: list[float]) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    theirs = pycolmap.Camera(model=model, width=640, height=480, params=params)
    points = np.random.default_rng(3).normal(size=(500, 3)) * [1.0, 1.0, 0.3] + [0.0, 0.0, 1.2]
    points = points[points[:, 2] > 0.2]
    expected = np.array([theirs.img_from_cam(p) for p in points], dtype=np.float64)
    np.testing.assert_allclose(lens(model, params).project(points), expected, atol=1e-9)


@pytest.mark.parametrize(("model", "params"), LENSES)
def test_rays_agree_with_colmap(model: str, params: list[float]) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    theirs = pycolmap.Camera(model=model, width=640, height=480, params=params)
    pixels = lens(model, params).pixel_centres()[10::46, 10::62].reshape(-1, 2)
    expected = np.array([[*theirs.cam_from_img(p), 1.0] for p in pixels])
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    rays = lens(model, params).unproject(pixels)
    forward = rays[:, 2] > 0.2
    np.testing.assert_allclose(rays[forward], expected[forward], atol=1e-6)
    assert forward.mean() > 0.5


@pytest.mark.parametrize(("model", "params"), LENSES)
def test_the_kernels_see_what_the_camera_sees(model: str, params: list[float]) -> None:
    """An image whose pixels hold their own column and row, read back along known rays."""
    camera = lens(model, params)
    grid = np.array([1.8, 0.01, 0.3, 0.01, 60.0, 120.0])
    turn = rotations.matrix(rotations.exp([0.2, -1.1, 0.1]))
    column, row = np.meshgrid(np.arange(120), np.arange(60))
    along, round_ = grid[0] - (column + 0.5) * grid[1], grid[2] + (row + 0.5) * grid[3]
    rays = np.stack([np.cos(along), np.sin(along) * np.cos(round_), np.sin(along) * np.sin(round_)], axis=-1) @ turn.T
    expected = camera.project(rays)
    for axis in (0, 1):
        ramp = np.round(camera.pixel_centres()[..., axis] * 255.0 / 640.0).astype(np.uint8)
        read = _mapping.rectify(ramp, lens_row(camera), turn, grid)
        inside = camera.contains(expected) & (np.abs(expected - [320.0, 240.0]) < [318.0, 238.0]).all(axis=-1)
        assert inside.mean() > 0.1
        assert np.abs(read[inside] - expected[inside][:, axis] * 255.0 / 640.0).max() < 1.1


@pytest.mark.parametrize(("model", "params"), LENSES)
def test_the_kernels_place_a_direction_to_a_fiftieth_of_a_pixel(model: str, params: list[float]) -> None:
    """Read off a steep ramp, towards directions from the axis to far out; a fisheye's radius comes from a table."""
    camera = lens(model, params)
    along_z = np.array([0.5 * np.pi + 0.005, 0.01, 0.5 * np.pi - 0.005, 0.01, 1.0, 1.0])
    levels_px = 32.0
    seen = 0
    for angle in np.radians([0.0, 3.0, 17.0, 31.0, 44.0, 58.0]):
        turn = rotations.matrix(rotations.exp([0.0, angle, 0.0]))
        expected = camera.project(turn[:, 2])
        if not camera.contains(expected[None]).all():
            continue
        first = np.floor(expected[0]) - 3.5
        ramp = np.clip(levels_px * (camera.pixel_centres()[..., 0] - first), 0, 255).astype(np.uint8)
        read = _mapping.rectify(ramp, lens_row(camera), turn, along_z).item()
        assert first + read / levels_px == pytest.approx(expected[0], abs=0.02)
        seen += 1
    assert seen >= 3


def test_directions_outside_the_field_of_view_have_no_pixel() -> None:
    camera = lens("OPENCV_FISHEYE", KB, field_of_view_rad=np.radians(165.0))
    angle = np.radians([80.0, 82.4, 82.6, 120.0])
    pixels = camera.project(np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1))
    assert np.isfinite(pixels[:, 0]).tolist() == [True, True, False, False]
    assert np.isfinite(camera.project([0.0, 0.0, 1.0])).all()
    assert np.isnan(camera.project([0.0, 0.0, -1.0])).all()
    assert not camera.contains([[np.nan, 3.0], [-0.1, 3.0], [640.0, 3.0]]).any()
    assert 0.5 < camera.lit().mean() <= 1.0


@pytest.mark.parametrize(("model", "params"), LENSES)
def test_nothing_straight_behind_or_nowhere_has_a_pixel(model: str, params: list[float]) -> None:
    """A lens that shows all around has its centre in the middle of the image, not straight behind as well."""
    camera = lens(model, params)
    assert np.isnan(camera.project([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [np.nan, 0.0, 1.0]])).all()


def test_the_kernels_show_nothing_straight_behind() -> None:
    camera = lens("SIMPLE_RADIAL_FISHEYE", [100.0, 320.0, 240.0, 0.0])
    assert camera.half_field_rad == np.pi
    along_z = np.array([0.5 * np.pi + 0.005, 0.01, 0.5 * np.pi - 0.005, 0.01, 1.0, 1.0])
    white = np.full((480, 640), 255, np.uint8)
    ahead, behind = (
        _mapping.rectify(white, lens_row(camera), np.diag([1.0, sign, sign]), along_z).item() for sign in (1.0, -1.0)
    )
    assert (ahead, behind) == (255, 0)


def test_model_ends_where_the_radius_stops_growing() -> None:
    camera = lens("SIMPLE_RADIAL_FISHEYE", [300.0, 320.0, 240.0, -0.3])
    assert camera.half_field_rad == pytest.approx(np.sqrt(1 / 0.9), abs=2e-3)


def test_rig_file_round_trips(tmp_path) -> None:
    T_down = frames.transform(rotations.exp([0.0, np.pi / 2, 0.0]), [0.02, 0.0, -0.08])
    front = lens("OPENCV_FISHEYE", KB, name="front", folder="front", field_of_view_rad=2.8)
    down = lens("RADIAL_FISHEYE", LENSES[3][1], name="down", folder="down", T_body_camera=T_down)
    rigs.save(tmp_path / "camera.toml", Rig((front, down), refine_intrinsics=True))
    back = rigs.load(tmp_path / "camera.toml")
    assert back.refine_intrinsics
    assert [c.name for c in back] == ["front", "down"]
    assert back.baseline_m == pytest.approx(np.hypot(0.02, 0.08))
    for a, b in zip((front, down), back, strict=True):
        assert (a.model, a.width, a.height, a.folder) == (b.model, b.width, b.height, b.folder)
        np.testing.assert_array_equal(a.params, b.params)
        np.testing.assert_allclose(a.T_body_camera, b.T_body_camera, atol=1e-15)
        assert a.field_of_view_rad == pytest.approx(b.field_of_view_rad)


GOOD = """format = "goshawk-camera"
version = 1
[[camera]]
name = "c"
model = "SIMPLE_RADIAL_FISHEYE"
width = 640
height = 480
params = [300.0, 320.0, 240.0, 0.05]
"""


def test_shortest_camera_file_is_one_camera_that_looks_ahead(tmp_path) -> None:
    (tmp_path / "camera.toml").write_text(GOOD)
    rig = rigs.load(tmp_path / "camera.toml")
    assert rig["c"].folder == "."
    ahead = frames.apply(rig["c"].T_body_camera, rig["c"].unproject([320.0, 240.0]))
    np.testing.assert_allclose(ahead, [1.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "kind", "word"),
    [
        ("SIMPLE_RADIAL_FISHEYE", "FANTASY", InputError, "FANTASY"),
        (", 0.05]", "]", InputError, "takes 4"),
        ("0.05]", "nan]", InputError, "finite"),
        ("300.0,", "-300.0,", InputError, "-300 px; for an image 640 px wide it must be from 32 to 64000 px"),
        ("300.0,", "31.9,", InputError, "focal length of 31.9 px"),
        ("300.0,", "64001.0,", InputError, "focal length of 64001 px"),
        ("320.0, 240.0", "640.0, 240.0", InputError, r"principal point \(640, 240\) px lies outside of the image"),
        ("320.0, 240.0", "320.0, -1.0", InputError, r"principal point \(320, -1\) px lies outside of the image"),
        ("width = 640\n", "", FormatError, "'width'"),
        ("width = 640", "width = 640.5", FormatError, "width is 640.5; a whole number is expected"),
        ("width = 640", 'width = "640"', FormatError, "width is '640'; a whole number is expected"),
        ("height = 480", "height = true", FormatError, "height is True; a whole number is expected"),
        ("height = 480", 'height = 480\nfield_of_view_deg = "wide"', FormatError, "'wide'; a number is expected"),
        ("height = 480", "height = 480\nfield_of_view_deg = 361", InputError, "361 degrees; .* at most 360 degrees"),
        ("height = 480", "height = 480\nfield_of_view_deg = 0", InputError, "0 degrees; .* above 0"),
        ("width = 640", "width = 2", InputError, "too small"),
        ("0.05]", "0.05, 1.0, 1.0]", InputError, "takes 4"),
        *(
            (
                GOOD[GOOD.index("model") :],
                f'model = "EUCM"\nwidth = 640\nheight = 480\nparams = [300, 300, 320, 240, {p}]',
                InputError,
                "alpha from 0 to 1",
            )
            for p in ("0.6, -1.0", "0.6, 0.0", "1.2, 1.0", "-0.1, 1.0")
        ),
        ("version = 1", "version = 2", FormatError, "update"),
        ("version = 1", 'version = 1\nintrinsics = "maybe"', FormatError, "maybe"),
        ("version = 1", 'version = 1\nintrinsic = "refine"', FormatError, "'intrinsic' is not one of format, version"),
        ("height = 480", "height = 480\nfield_of_view = 165.0", FormatError, "'field_of_view' is not one of name"),
        ("height = 480", "height = 480\nT_body_cam = {q=[1,0,0,0], t=[0,0,0]}", FormatError, "'T_body_cam' is not"),
        ("goshawk-camera", "goshawk-map", FormatError, "goshawk-map"),
        ("height = 480", "height = 480\nT_body_camera = {q=[1,1,0,0], t=[0,0,0]}", InputError, "camera c: .* unit"),
        ("height = 480", "height = 480\nT_body_camera = {q=[1,0,0,0], t=[0,nan,0]}", InputError, "camera c: .* finite"),
        ("height = 480", "height = 480\nT_body_camera = {q=[1,0,0,0], t=[6,8.1,0]}", InputError, "10.08 m .* 10 m"),
        ("height = 480", "height = 480\nT_body_camera = {q=[1,0,0,0]}", FormatError, "'t'"),
    ],
)
def test_damaged_camera_file_is_refused_in_one_sentence(tmp_path, old: str, new: str, kind: type, word: str) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(kind, match=word) as caught:
        rigs.load(path)
    assert "\n" not in str(caught.value)


def test_cameras_of_a_rig_may_not_share_a_folder() -> None:
    for other in ("front", "./front", "front/"):
        with pytest.raises(InputError, match="share the folder"):
            Rig(
                (
                    lens("OPENCV_FISHEYE", KB, name="a", folder="front"),
                    lens("OPENCV_FISHEYE", KB, name="b", folder=other),
                )
            )
