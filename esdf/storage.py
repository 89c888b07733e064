"""A distance field on disk: a folder that is either whole or absent.

`esdf.toml` holds the field's settings and hash; `state.npz` holds the voxels. Distances are rebuilt on
loading, which is faster than reading them and cannot disagree with the voxels. `edits.json`, if there is one, is the
pilot's list of edits: saving a rebuilt map keeps it, loading replays it.
"""

import shutil
import zipfile
import zlib
from pathlib import Path

import numpy as np

from esdf.build import build
from esdf.edits import EDITS, Edit, Editor, load_edits
from esdf.field import Field
from esdf.grid import Grid
from flight import FormatError, InputError, file_format

FORMAT = "goshawk-esdf"
VERSION = 1


def save(folder: Path, field: Field) -> None:
    """Write a mapped field; an earlier one in `folder` stays until the new one is complete.

    Raises:
        InputError: the disk is full or the folder cannot be written; the earlier field is untouched.
    """
    body = {
        **field.grid.as_dict(),
        "cap_m": field.cap_m,
        "unknown": field.unknown,
        "hash": field.hash,
    }
    try:
        with file_format.atomic_folder(folder) as temporary:
            if (Path(folder) / EDITS).exists():
                shutil.copy(Path(folder) / EDITS, temporary / EDITS)
            np.savez_compressed(temporary / "state.npz", state=field.state)
            file_format.write_toml(temporary / "esdf.toml", format=FORMAT, version=VERSION, body=body)
    except OSError as error:
        raise InputError(
            f"{folder}: the distance field was not written ({error.strerror or error}); the old one stays"
        ) from error


def load(folder: Path) -> Field:
    """Read a field, its edits applied. Raises as `open_editor`."""
    mapped, edits = _read(Path(folder))
    return Editor(mapped, edits).field if edits else mapped


def open_editor(folder: Path) -> Editor:
    """Read a field and its edits into an `Editor`.

    Raises:
        InputError: there is none in `folder`.
        FormatError: it is damaged, or newer than this version.
    """
    return Editor(*_read(Path(folder)))


def _read(folder: Path) -> tuple[Field, tuple[Edit, ...]]:
    document = file_format.read_toml(folder / "esdf.toml", format=FORMAT, version=VERSION)
    try:
        grid = Grid.from_dict(document)
        with np.load(folder / "state.npz") as archive:
            state = archive["state"]
        field = build(state, grid, cap_m=float(document["cap_m"]), unknown=document["unknown"])
        wanted = str(document["hash"])
    except (KeyError, TypeError, ValueError, EOFError, OSError, zipfile.BadZipFile, zlib.error, InputError) as error:
        raise FormatError(
            f"{folder} holds a damaged distance field: {file_format.damage_text(error)}; build the map again"
        ) from error
    if field.hash != wanted:
        raise FormatError(f"{folder} holds a damaged distance field: its voxels do not match its hash")
    return field, load_edits(folder / EDITS) if (folder / EDITS).exists() else ()
