"""Flights of the rendered room that must not end in a map called good: wrong lens files, swapped folders, tiles."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import mapping
from flight import FlightError, FloatArray
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from goshawk.rendered.world import RenderedFlight
from mapping import stages, verdict
from mapping.camera.rig import Camera, Rig
from mapping.input import source
from mapping.sparse import reconstruction
from mapping.verdict import Standing

SCALE, COUNT, SHARE, RATE_HZ = 0.75, 14, 0.18, 10.0
"""Of the images, instants, part of the loop, instants a second."""


@dataclass(frozen=True, slots=True)
class Case:
    """Images, and a camera file that is not theirs or walls that all look alike."""

    is_tiled: bool
    """Whether the images are of the tiled room."""
    rig: Rig
    """What the camera file says."""
    named: str
    """What an answer must name as the cause."""


def cases() -> dict[str, Case]:
    """By name."""
    rig = rendered_world.default_rig(SCALE)
    front, down = rig.cameras
    swapped = (dataclasses.replace(front, folder=down.folder), dataclasses.replace(down, folder=front.folder))
    return {
        "swapped folders": Case(False, Rig(swapped), "exchanged"),
        "focal length 10 % too long": Case(False, _of_each(rig, lambda c: _longer(c, 1.1)), "camera file"),
        "focal length 10 % too short": Case(False, _of_each(rig, lambda c: _longer(c, 0.9)), "camera file"),
        "lens without distortion": Case(False, _of_each(rig, _pinhole), "camera file"),
        "repeated texture": Case(True, rig, "repeated texture"),
    }


def render(folder: Path, *, is_tiled: bool) -> Path:
    """The images that the cases share, with the right camera file."""
    path = rendered_world.loop_flight(COUNT, share=SHARE)
    return rendered_world.write_rendered_sequence(
        folder,
        rig=rendered_world.default_rig(SCALE),
        flight=RenderedFlight(np.arange(COUNT) / RATE_HZ, path.T_world_body),
        scene=rendered_room.tiled() if is_tiled else rendered_room.furnished(),
    )


def outcome(folder: Path, rig: Rig) -> tuple[str, str]:
    """What comes of images and a camera file: the map's verdict, or "refused" if there is no map, and why."""
    try:
        images = mapping.read_folder(folder, rig)
        with stages.temporary() as work:
            source.require_usable(work, images)
            placed = reconstruction.reconstruct(images, work=work)
    except FlightError as error:
        return Standing.REFUSED, str(error)
    found = verdict.judge(placed)
    return found.standing, "; ".join(found.reasons)


def _of_each(rig: Rig, change: Callable[[Camera], Camera]) -> Rig:
    return dataclasses.replace(rig, cameras=tuple(change(camera) for camera in rig))


def _longer(camera: Camera, factor: float) -> Camera:
    params: FloatArray = camera.params.copy()
    params[:2] *= factor
    return dataclasses.replace(camera, params=params)


def _pinhole(camera: Camera) -> Camera:
    return dataclasses.replace(camera, model="PINHOLE", params=camera.params[:4])
