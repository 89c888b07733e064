"""The mesh in colours of height in place of its own, in a real viser server without a browser."""

import numpy as np

from flight import silent
from gcs_web.app import _viser
from gcs_web.map.map_view import _ruler_step_m
from gcs_web.map.mesh_view import MeshView
from mapping.dense import mesh_file


def test_heights_take_the_place_of_the_mesh_but_not_while_it_is_painted(tmp_path):
    corners = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 3.0]], dtype=np.float32)
    grey = np.full((3, 3), 128, dtype=np.uint8)
    mesh_file.save(tmp_path / "mesh.glb", corners, np.array([[0, 1, 2]], dtype=np.int32), grey)
    server = _viser()
    try:
        view = MeshView(server, 100, tmp_path / "cache", silent)
        view.draw(tmp_path / "mesh.glb")
        view.show(True, by_height=False)
        assert view._heights is None
        view.show(True, by_height=True)
        assert view._heights.visible
        view.paint(True)
        assert not view._heights.visible
        view.paint(False)
        assert view._heights.visible
        view.show(False, by_height=True)
        assert not view._heights.visible
        view.close()
    finally:
        server.stop()


def test_a_ruler_has_few_marks_at_round_metres():
    for length_m in (0.5, 3.0, 8.0, 30.0, 170.0, 4000.0):
        step_m = _ruler_step_m(length_m)
        assert length_m / step_m <= 8.0
        assert step_m in {power * digit for power in (1, 10, 100, 1000) for digit in (1, 2, 5)}
