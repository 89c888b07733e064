"""What several rooms' tests share: a small mapped room, without photographs."""

import os
import signal
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line and the Makefile do, before NumPy is imported

import numpy as np
import pytest

# A shell that starts the tests in the background has Ctrl-C ignored, and every child would inherit that.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def pillar_map(tmp_path_factory) -> Path:
    """A map folder of a 6 x 4 x 2.5 m room with two pillars, made from solids."""
    import trimesh

    import esdf
    import mapping
    from esdf import solids
    from flight import file_format
    from mapping import map_folder, rendered_world, rig

    pillars = [solids.Cylinder((2.0, 1.5, 1.25), 0.25, 2.5), solids.Cylinder((4.0, 2.6, 1.25), 0.35, 2.5)]
    room = solids.Scene([solids.Room((0.0, 0.0, 0.0), (6.0, 4.0, 2.5)), *pillars])
    grid = esdf.Grid(np.full(3, -0.2), np.full(3, 0.05), (128, 88, 58))
    field = esdf.build(esdf.rasterize(room, grid), grid)
    parts = [trimesh.creation.box(bounds=[[0.0, 0.0, -0.05], [6.0, 4.0, 0.0]])]
    for pillar in pillars:
        part = trimesh.creation.cylinder(pillar.radius_m, pillar.height_m)
        part.apply_translation(pillar.centre_world_m)
        parts.append(part)

    folder = tmp_path_factory.mktemp("maps") / "map"
    folder.mkdir()
    esdf.save(folder / "esdf", field)
    trimesh.util.concatenate(parts).export(folder / "mesh.glb")
    rig.save(folder / "camera.toml", rendered_world.default_rig())
    (folder / "poses.csv").write_text("image,time_s,x_m,y_m,z_m,qw,qx,qy,qz\n0.png,0,1,1,1,1,0,0,0\n")
    file_format.write_toml(folder / "map.toml", format=map_folder.FORMAT, version=1, body={"hash": field.hash})
    assert mapping.open_map(folder).hash == field.hash
    return folder
