"""Fields for other tools: NumPy archives, NRRD volumes, PLY points. Only `.npz`, which is lossless, can be imported."""

import zipfile
from pathlib import Path

import numpy as np

from esdf.build import build
from esdf.field import Field
from esdf.grid import UNKNOWN, Grid
from flight import FormatError, InputError, errors, file_format

PLY_COMMENT = "comment signed distance in metres"
"""Line of a PLY header, of points that are voxels with distances and not places that were measured."""


def export_npz(path: Path, field: Field) -> None:
    """Everything in one `.npz`: `state`, `distance_m`, lattice, cap, policy."""
    with file_format.atomic_file(Path(path)) as temporary, open(temporary, "wb") as file:
        np.savez_compressed(
            file,
            version=1,
            origin_world_m=field.grid.origin_world_m,
            voxel_m=field.grid.voxel_m,
            cap_m=field.cap_m,
            unknown=field.unknown,
            state=field.state,
            distance_m=field.values_m,
        )


def import_npz(path: Path) -> Field:
    """Read what `export_npz` wrote (distances are rebuilt from the states).

    Raises:
        InputError: there is no such file.
        FormatError: it is damaged, newer, or its distances are not those of its states.
    """
    try:
        with np.load(path) as archive:
            if int(archive["version"]) > 1:
                raise FormatError(f"{path} is version {int(archive['version'])}; this Goshawk reads 1: update Goshawk")
            state, stored = archive["state"], archive["distance_m"]
            grid = Grid(tuple(archive["origin_world_m"]), tuple(archive["voxel_m"]), state.shape)
            field = build(state, grid, cap_m=float(archive["cap_m"]), unknown=str(archive["unknown"]))  # pyright: ignore[reportArgumentType]
    except FileNotFoundError:
        raise errors.missing(path) from None
    except (KeyError, ValueError, EOFError, OSError, zipfile.BadZipFile, InputError) as error:
        raise FormatError(
            f"{path} is a damaged distance field: {file_format.damage_text(error)}; build the map again"
        ) from error
    if not np.array_equal(stored, field.values_m, equal_nan=True):
        raise FormatError(f"{path}: its distances do not match its states; the file was changed after export")
    return field


def export_nrrd(path: Path, field: Field) -> None:
    """The distances as a NRRD volume (float32, x fastest, positions in world metres), for 3D Slicer, ParaView..."""
    nx, ny, nz = field.grid.shape
    first = field.grid.centre([0, 0, 0])
    dx, dy, dz = field.grid.voxel_m
    header = (
        "NRRD0004\ntype: float\ndimension: 3\nspace dimension: 3\nencoding: raw\nendian: little\n"
        f"sizes: {nx} {ny} {nz}\n"
        f"space directions: ({dx!r},0,0) (0,{dy!r},0) (0,0,{dz!r})\n"
        f"space origin: ({float(first[0])!r},{float(first[1])!r},{float(first[2])!r})\n"
        'space units: "m" "m" "m"\ncontent: signed distance in metres\n\n'
    )
    data = np.asfortranarray(field.values_m).astype("<f4", copy=False).tobytes(order="F")
    file_format.write_bytes(Path(path), header.encode() + data)


def export_ply(path: Path, field: Field, *, closer_than_m: float) -> int:
    """Known voxel centres nearer than a distance to a surface, each with its `distance`, as a PLY point cloud.

    Returns:
        How many points were written.
    """
    chosen = (field.state != UNKNOWN) & (np.abs(field.values_m) < closer_than_m)
    index = np.argwhere(chosen)
    rows = np.empty(len(index), [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("distance", "<f4")])
    rows["x"], rows["y"], rows["z"] = field.grid.centre(index).T
    rows["distance"] = field.values_m[chosen]
    header = f"ply\nformat binary_little_endian 1.0\n{PLY_COMMENT}\nelement vertex {len(rows)}\n"
    header += "".join(f"property float {name}\n" for name in ("x", "y", "z", "distance")) + "end_header\n"
    file_format.write_bytes(Path(path), header.encode() + rows.tobytes())
    return len(rows)
