"""A thin pole, a cable and a plain wall, which block matching misses: the map does not call them free."""

import numpy as np
import pytest

from goshawk.rendered import safety
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from mapping.dense import surface
from mapping.dense.surface import ImageView

INSTANTS, SHARE = 32, 0.52
NEAR_THE_WALL = slice(7, 19)


@pytest.mark.slow
def test_what_the_images_do_not_show_is_unknown_and_not_free() -> None:
    scene, rig = rendered_room.hazardous(), rendered_world.default_rig()
    poses = rendered_world.loop_flight(INSTANTS, share=SHARE).T_world_body[NEAR_THE_WALL]
    views = [
        ImageView(
            camera, T @ camera.T_body_camera, rendered_world.render(camera, T, scene=scene, seed=len(rig) * i + number)
        )
        for i, T in enumerate(poses)
        for number, camera in enumerate(rig)
    ]
    result = surface.reconstruct(views)
    found = safety.score(result.state, result.grid, result.seen, result.inferred)
    assert found.free_m3 > 20.0
    assert found.free_share_in_matter <= 2e-4
    assert found.behind_wall.free <= 0.01
    assert found.pole.free <= 0.05
    assert found.wall.occupied + found.wall_inferred >= 0.5  # all 64 images of the benchmark show more of its edges
    assert found.inferred_not_near_matter <= 0.05
    assert found.overstated_unexplained <= 1e-3
    free = result.grid.centre(np.argwhere(result.state == safety.FREE))
    assert rendered_room.PLAIN_WALL.distance(free).min() > 0.0
