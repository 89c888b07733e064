"""Universal Scene Description: what is written opens in Pixar's library, and what that writes is read where it is."""

from pathlib import Path

import numpy as np
import pytest

from flight import FlightError, InputError
from mapping import foreign_mesh
from mapping.dense import usd_file

VERTICES = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32)
COLOURS = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 9, 9]], np.uint8)


def write(path: Path) -> Path:
    path.write_bytes(usd_file.encode(VERTICES, FACES, COLOURS))
    return path


def test_a_file_states_metres_and_up_and_holds_every_number(tmp_path: Path) -> None:
    text = write(tmp_path / "room.usda").read_text()
    assert text.startswith("#usda 1.0\n")
    assert "metersPerUnit = 1\n" in text
    assert 'upAxis = "Z"' in text
    assert "(3, 0, 0), (0, 2, 0), (0, 0, 1)]" in text
    assert f"[{', '.join(map(str, FACES.ravel()))}]" in text


def test_without_pixars_library_a_file_is_refused_with_the_way_out(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pxr", None)
    with pytest.raises(InputError, match="pip install usd-core, or export it as GLB"):
        foreign_mesh.read(write(tmp_path / "room.usda"))


def test_what_is_written_opens_in_pixars_library(tmp_path: Path) -> None:
    usd, geometry = pytest.importorskip("pxr.Usd"), pytest.importorskip("pxr.UsdGeom")
    stage = usd.Stage.Open(str(write(tmp_path / "room.usda")))
    mesh = geometry.Mesh(stage.GetDefaultPrim())
    np.testing.assert_allclose(np.array(mesh.GetPointsAttr().Get()), VERTICES)
    np.testing.assert_array_equal(np.array(mesh.GetFaceVertexIndicesAttr().Get()), FACES.ravel())
    np.testing.assert_allclose(np.array(mesh.GetDisplayColorAttr().Get()), COLOURS / 255.0, atol=1e-3)
    assert (geometry.GetStageMetersPerUnit(stage), geometry.GetStageUpAxis(stage)) == (1.0, "Z")
    read = foreign_mesh.read(tmp_path / "room.usda")
    corners = read.vertices_world_m[read.faces]
    np.testing.assert_allclose(sorted(corners.reshape(-1, 9).tolist()), sorted(VERTICES[FACES].reshape(-1, 9).tolist()))
    assert "metersPerUnit" in read.unit
    assert "upAxis" in read.up


@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
def test_centimetres_y_up_polygons_and_transforms_of_others_are_read(tmp_path: Path, suffix: str) -> None:
    usd, geometry = pytest.importorskip("pxr.Usd"), pytest.importorskip("pxr.UsdGeom")
    stage = usd.Stage.CreateNew(str(tmp_path / f"their{suffix}"))
    geometry.SetStageMetersPerUnit(stage, 0.01)
    geometry.SetStageUpAxis(stage, "Y")
    mover = geometry.Xform.Define(stage, "/room")
    mover.AddTranslateOp().Set((100.0, 200.0, 300.0))
    mesh = geometry.Mesh.Define(stage, "/room/wall")
    mesh.GetPointsAttr().Set([(0, 0, 0), (100, 0, 0), (100, 50, 0), (0, 50, 0)])
    mesh.GetFaceVertexCountsAttr().Set([4])
    mesh.GetFaceVertexIndicesAttr().Set([0, 1, 2, 3])
    hidden = geometry.Mesh.Define(stage, "/hidden")
    hidden.GetPointsAttr().Set([(0, 0, 0), (9000, 0, 0), (0, 9000, 0)])
    hidden.GetFaceVertexCountsAttr().Set([3])
    hidden.GetFaceVertexIndicesAttr().Set([0, 1, 2])
    hidden.MakeInvisible()
    stage.Save()
    read = foreign_mesh.read(tmp_path / f"their{suffix}")
    assert len(read.faces) == 2
    np.testing.assert_allclose(read.vertices_world_m.min(axis=0), [1.0, -3.0, 2.0], atol=1e-6)
    np.testing.assert_allclose(read.vertices_world_m.max(axis=0), [2.0, -3.0, 2.5], atol=1e-6)


QUAD = """def Mesh "wall" {
 int[] faceVertexCounts = [4]
 int[] faceVertexIndices = [0, 1, 2, 3]
 point3f[] points = [(0, 0, 0), (5, 0, 0), (5, 0, 3), (0, 0, 3)]
}
"""
HEAD = '#usda 1.0\n(\n metersPerUnit = 1\n upAxis = "Z"\n)\n'
COPY = """def Xform "copy" (
 instanceable = true
 prepend references = </room>
) {
 double3 xformOp:translate = (20, 0, 0)
 uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
TREES = """def PointInstancer "trees" {
 int[] protoIndices = [0]
 point3f[] positions = [(10, 0, 0)]
 rel prototypes = </trees/p>
}
"""


def stage(path: Path, text: str) -> Path:
    pytest.importorskip("pxr.Usd")
    path.write_text(text)
    return path


def test_instances_are_read_where_they_stand(tmp_path: Path) -> None:
    read = foreign_mesh.read(stage(tmp_path / "a.usda", HEAD + 'def Xform "room" {\n' + QUAD + "}\n" + COPY))
    assert len(read.faces) == 4
    np.testing.assert_allclose(read.vertices_world_m.max(axis=0), [25.0, 0.0, 3.0])


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('def Cube "pillar" {\n}\n', "shows a Cube, /pillar; only meshes are read"),
        (TREES, "shows a PointInstancer, /trees"),
        ('def "other" (\n prepend references = @./not_there.usd@\n) {\n}\n', "is not whole: .*not_there.usd"),
        (QUAD.replace("wall", "cut").replace("[0, 1, 2, 3]", "[0, 1, 2]"), "damaged"),
        (QUAD.replace("wall", "cut").replace("[0, 1, 2, 3]", "[0, 1, 2, 4]"), "damaged"),
        ("nonsense", "damaged, or not USD; export it again$"),
    ],
)
def test_what_would_be_left_out_is_refused_by_name(tmp_path: Path, more: str, said: str) -> None:
    with pytest.raises(FlightError, match=said):
        foreign_mesh.read(stage(tmp_path / "a.usda", HEAD + QUAD + more))


def test_hidden_things_that_are_no_meshes_do_not_matter(tmp_path: Path) -> None:
    hidden = 'def Cube "pillar" {\n token visibility = "invisible"\n}\n'
    assert len(foreign_mesh.read(stage(tmp_path / "a.usda", HEAD + QUAD + hidden)).faces) == 2


def test_of_points_over_time_the_earliest_are_read(tmp_path: Path) -> None:
    later = ".timeSamples = {3: [(0, 0, 0), (5, 0, 0), (5, 0, 3), (0, 0, 3)], 9: [(0, 0, 0)]}"
    start = QUAD.index(" = [(0")
    moved = QUAD[:start] + later + "\n}\n"
    read = foreign_mesh.read(stage(tmp_path / "a.usda", HEAD + moved))
    np.testing.assert_allclose(read.vertices_world_m.max(axis=0), [5.0, 0.0, 3.0])


def test_a_file_without_an_axis_is_said_to_have_none(tmp_path: Path) -> None:
    read = foreign_mesh.read(stage(tmp_path / "a.usda", "#usda 1.0\n" + QUAD))
    assert "Pixar's rule; the file does not say" in read.up
    assert np.ptp(read.vertices_world_m, axis=0) == pytest.approx([5.0, 3.0, 0.0])


def test_numbers_are_as_fine_as_the_file_stores_them_whatever_its_transforms(tmp_path: Path) -> None:
    def moved(points: str, x_m: float) -> Path:
        place = f"double3 xformOp:translate = ({x_m}, 0, 0)\n"
        order = 'uniform token[] xformOpOrder = ["xformOp:translate"]\n'
        return stage(tmp_path / "a.usda", HEAD + f'def Xform "room" {{\n{place}{order}' + points + "}\n")

    far = QUAD.replace("(0, 0, ", "(512000.25, 0, ").replace("(5, 0, ", "(512005.25, 0, ")
    with pytest.raises(FlightError, match="single precision"):
        foreign_mesh.read(moved(far, -512000.03))
    found = foreign_mesh.read(moved(QUAD, 512000.0), origin=np.array([512000.0, 0.0, 0.0]))
    np.testing.assert_allclose(np.ptp(found.vertices_world_m, axis=0), [5.0, 0.0, 3.0])


@pytest.mark.parametrize("name", ["a.nvdb", "a.nvblx"])
def test_kinds_that_no_package_reads_are_refused_by_name_with_a_way_out(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"x")
    with pytest.raises(InputError, match=r"nanovdb_convert|as PLY"):
        foreign_mesh.read(tmp_path / name)
