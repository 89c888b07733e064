"""The furnished room on a bad day: crates moved meanwhile, blurred images, exposure jumps, a blank wall."""

import numpy as np

from esdf.solids import Box
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from goshawk.rendered.scene import RenderedScene
from goshawk.rendered.world import Picture, RenderedFlight
from mapping.camera.rig import Rig

CRATE_M = (0.7, 0.6, 0.6)
CRATES_WORLD_M = (
    ((-3.2, -3.4), (1.9, 2.6), (2.0, -0.9)),
    ((-1.7, -3.2), (3.4, 1.3), (3.6, -2.9)),
    ((-3.6, 1.9), (0.6, -3.3), (1.2, 2.7)),
)
"""x and y of the three crates, in the first half of a flight, in its second, and later."""
BLURRED_EVERY, BLUR_PX = 5, 9
"""Every fifth instant is blurred, along the rows: 1.8 deg while the shutter is open. Odd, so that the pose is that of
the middle of the exposure: a filter of 8 px moves all it shows by half a pixel, as no motion of the rig does."""
JUMPS = (1.0, 0.65, 1.0, 1.4)
JUMP_EVERY = 7
"""Gain, which jumps to the next after so many instants."""


def scene(moved: int) -> RenderedScene:
    """The furnished room with the blank wall, and the crates where `CRATES_WORLD_M[moved]` says."""
    x_m, y_m, z_m = CRATE_M
    crates = [(Box((x, y, 0.0), (x + x_m, y + y_m, z_m)), "wood") for x, y in CRATES_WORLD_M[moved]]
    blank = (rendered_room.PLAIN_WALL, "plain")
    return RenderedScene((*rendered_room.furnished().painted, blank, *crates))


def pictures(rig: Rig, flight: RenderedFlight, seed: int, *, is_later: bool = False) -> Picture:
    """The images of a flight for a map, or of a later one (`is_later`), whose crates stand where no map shows them."""
    count = len(flight.times_s)
    scenes = (scene(2), scene(2)) if is_later else (scene(0), scene(1))

    def picture(instant: int, number: int) -> np.ndarray:
        gain = rendered_world.GAIN * JUMPS[instant // JUMP_EVERY % len(JUMPS)]
        image = rendered_world.render(
            rig.cameras[number],
            flight.T_world_body[instant],
            scene=scenes[int(2 * instant >= count)],
            seed=seed * 1_000_003 + instant * len(rig) + number,
            gain=gain,
        )
        is_blurred = instant % BLURRED_EVERY == BLURRED_EVERY - 1
        return blurred(image) if is_blurred else image

    return picture


def blurred(image: np.ndarray) -> np.ndarray:
    """The image (height, width) as a motion along its rows would blur it."""
    import cv2

    return np.asarray(cv2.blur(image, (BLUR_PX, 1)))
