"""What is drawn is what is known: colours follow clearance."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight import MapError
from gcs_web import scene


@settings(deadline=None)  # the first call loads the colour scales
@given(st.floats(-1.0, 5.0), st.floats(-1.0, 5.0))
def test_more_clearance_is_never_brighter(a, b):
    """Brightness alone carries the order, for those who see no colours."""
    low, high = sorted([a, b])
    brightness = scene.clearance_colours(np.array([low, high]), 0.3) @ [0.2126, 0.7152, 0.0722]
    assert brightness[1] <= brightness[0] + 1e-9


def test_unknown_clearance_is_drawn_as_the_worst():
    colours = scene.clearance_colours(np.array([np.nan, -1.0, 0.3]), 0.3)
    np.testing.assert_array_equal(colours[0], colours[1])
    np.testing.assert_array_equal(colours[0], colours[2])


def test_a_mesh_is_simplified_in_steps_that_are_reported(tmp_path, monkeypatch):
    import trimesh

    trimesh.creation.icosphere(4).export(tmp_path / "mesh.ply")
    monkeypatch.setattr(scene, "TRIANGLES_PER_STEP", 1500)
    told = []
    mesh = scene.display_mesh(tmp_path / "mesh.ply", 1000, progress=lambda stage, fraction: told.append(fraction))
    np.testing.assert_allclose(told, [0.0, 1 / 3, 2 / 3])
    assert 900 <= len(mesh.faces) <= 1000
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 1.0, atol=0.05)


def test_a_mesh_that_cannot_be_read_is_said_and_not_drawn_as_nothing(tmp_path):
    for content in (b"", b"not a mesh", b"glTF" + bytes(40)):
        (tmp_path / "mesh.glb").write_bytes(content)
        with pytest.raises(MapError, match=r"mesh\.glb holds no triangles or cannot be read"):
            scene.display_mesh(tmp_path / "mesh.glb")
