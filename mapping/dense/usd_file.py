"""Meshes as Universal Scene Description: written as text (`.usda`), read through Pixar's library where it is installed.

`usd-core` has 29 MB and is not among our dependencies: it is asked for when a file needs it.
"""

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight import FloatArray, FormatError, InputError
from mapping import reach

SUFFIXES = (".usda", ".usd", ".usdc", ".usdz")
WRITTEN = ".usda"
_A_LINE = 64


@dataclass(frozen=True, slots=True)
class Stated:
    """What a file says of itself."""

    unit_m: float | None
    """None: it does not say."""
    up: str | None
    """`y` or `z`; None: it does not say."""


def encode(vertices_world_m: FloatArray, faces: NDArray[np.int32], colours: NDArray[np.uint8]) -> bytes:
    """A mesh with colours of its vertices, in metres with z up."""
    points = [f"({x:.9g}, {y:.9g}, {z:.9g})" for x, y, z in vertices_world_m]
    shades = [f"({r:.4g}, {g:.4g}, {b:.4g})" for r, g, b in colours / 255.0]
    body = (
        "#usda 1.0\n(\n"
        '    defaultPrim = "map"\n    metersPerUnit = 1\n    upAxis = "Z"\n)\n\n'
        'def Mesh "map"\n{\n'
        f"    int[] faceVertexCounts = [{_lines(['3'] * len(faces))}]\n"
        f"    int[] faceVertexIndices = [{_lines([str(k) for k in faces.ravel()])}]\n"
        f"    point3f[] points = [{_lines(points)}]\n"
        f"    color3f[] primvars:displayColor = [{_lines(shades)}] (\n"
        '        interpolation = "vertex"\n    )\n'
        '    uniform token subdivisionScheme = "none"\n}\n'
    )
    return body.encode()


def _lines(words: list[str]) -> str:
    return ",\n".join(", ".join(words[k : k + _A_LINE]) for k in range(0, len(words), _A_LINE))


def read(path: Path) -> tuple[FloatArray, NDArray[np.int64], float, Stated]:
    """Vertices (v, 3) in the file's units and axes, triangles (f, 3), how far apart numbers are, and what it states.

    Of all meshes that are shown by default, instances too, each where its transforms place it at the earliest time;
    polygons become fans of triangles. Numbers are as far apart as `reach.single_step` tells, before the transforms.

    Raises:
        InputError: Pixar's library is not installed, or the file shows other things than meshes.
        FormatError: it cannot be read, or a file that it names is missing.
    """
    try:
        usd, geometry = (importlib.import_module(f"pxr.{name}") for name in ("Usd", "UsdGeom"))
    except ImportError:
        raise InputError(
            f"{path} needs Pixar's library to be read: pip install usd-core, or export it as GLB, with Blender say"
        ) from None
    try:
        stage: Any = usd.Stage.Open(str(path))
        time = usd.TimeCode.EarliestTime()
        prims = list(stage.Traverse(usd.TraverseInstanceProxies()))
        shown = [prim for prim in prims if _is_geometry(geometry, prim) and _is_shown(geometry, prim, time)]
        others = [prim for prim in shown if not prim.IsA(geometry.Mesh)]
        missing = [str(error) for error in stage.GetCompositionErrors()]
        transforms = geometry.XformCache(time)
        parts = [] if others or missing else [_part(geometry.Mesh(prim), transforms, time) for prim in shown]
        stated = (
            Stated(  # not Pixar's rules: without a statement a unit is a centimetre by these, in few files in truth
                float(geometry.GetStageMetersPerUnit(stage)) if stage.HasAuthoredMetadata("metersPerUnit") else None,
                str(geometry.GetStageUpAxis(stage)).lower() if stage.HasAuthoredMetadata("upAxis") else None,
            )
        )
    except Exception as error:  # the library raises what it likes, and names its own lines
        raise FormatError(f"{path} cannot be read: it is damaged, or not USD; export it again") from error
    if missing:
        raise FormatError(f"{path} is not whole: {' '.join(missing[0].split())[:200]}; bring it, or flatten the file")
    if others:
        raise InputError(
            f"{path} shows a {others[0].GetTypeName()}, {others[0].GetPath()}; only meshes are read: make it a mesh, "
            "with Blender say, or hide it"
        )
    starts = np.cumsum([0, *(len(vertices) for vertices, *_ in parts)])
    vertices = np.concatenate([np.zeros((0, 3)), *(each for each, *_ in parts)])
    faces = [np.zeros((0, 3), np.int64), *(f + start for (_, f, _), start in zip(parts, starts[:-1], strict=True))]
    return vertices, np.concatenate(faces), max((step for *_, step in parts), default=0.0), stated


def _is_geometry(geometry: Any, prim: Any) -> bool:
    return prim.IsA(geometry.Gprim) or prim.IsA(geometry.PointInstancer)


def _is_shown(geometry: Any, prim: Any, time: Any) -> bool:
    is_hidden = geometry.Imageable(prim).ComputeVisibility(time) == geometry.Tokens.invisible
    return not is_hidden and geometry.Imageable(prim).ComputePurpose() in ("default", "render")


def _part(mesh: Any, transforms: Any, time: Any) -> tuple[FloatArray, NDArray[np.int64], float]:
    """Vertices and triangles of one mesh, in the stage's axes, and how far apart its numbers are there."""
    points = np.array(mesh.GetPointsAttr().Get(time) or (), dtype=np.float64).reshape(-1, 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(time) or (), dtype=np.int64)
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(time) or (), dtype=np.int64)
    T = np.array(transforms.GetLocalToWorldTransform(mesh.GetPrim()), dtype=np.float64)  # of rows, as Pixar has it
    starts = np.repeat(np.cumsum(counts) - counts, np.maximum(counts - 2, 0))
    own = np.concatenate([np.zeros(0, np.int64), *(np.arange(n - 2) for n in counts if n > 2)])
    faces = np.stack([corners[starts], corners[starts + own + 1], corners[starts + own + 2]], axis=1)
    if faces.size and not 0 <= faces.min() <= faces.max() < len(points):  # of the whole it may name another mesh's
        raise IndexError
    step = reach.single_step(points) * float(np.cbrt(abs(np.linalg.det(T[:3, :3]))))
    return points @ T[:3, :3] + T[3, :3], faces, step
