"""A folder of images or a video as what a map is made of: read, selected, and examined before any long work."""

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flight import InputError, Progress, file_format, silent
from mapping.camera import rig as rigs
from mapping.camera.rig import Rig
from mapping.input import examination, masks, selection, video
from mapping.input.depth_images import DepthFolder
from mapping.input.images import ImageSet, read_folder
from mapping.input.selection import SelectionOptions
from mapping.stages import Work

FRAMES, CHECK = "frames", "check"
"""Stages whose results survive an interrupted work; the first is a video's only."""


@dataclass(frozen=True, slots=True)
class Source:
    """What was given to be mapped."""

    path: Path
    """A folder of images, or a video."""
    rig: Rig
    """The cameras."""
    masks: Path | None = None
    """Folder of masks."""
    depths: DepthFolder | None = None
    """Depth images of a folder of images."""
    selection: SelectionOptions | None = None
    """How images are chosen; all of a folder are used without, a video's frames as by default."""

    @property
    def is_video(self) -> bool:
        return video.is_video(self.path)

    def read(self, *, progress: Progress = silent) -> ImageSet:
        """The images of the folder that are to be used, checked.

        Raises:
            InputError: as `read_folder`; or the camera hardly moves.
        """
        read = read_folder(self.path, self.rig, masks=self.masks, depths=self.depths, progress=progress)
        if self.selection is None:
            return read
        first = [instant for instant, camera in read.pairs() if camera == 0]
        grays = (read.gray(instant, 0) for instant in first)
        chosen = selection.choose(grays, self.rig.cameras[0], self.selection, used=self._camera_mask())
        if len(chosen) < 2:
            raise InputError(f"{self.path}: the camera hardly moves in its {len(first)} images; a map needs parallax")
        return read.only(np.array(first)[chosen])

    def frames(self, begun: Work, *, progress: Progress = silent) -> ImageSet:
        """The chosen frames of the video, as images; they stay in the work's folder until the map is made.

        Raises:
            InputError: as `video.extract`.
        """
        if self.depths is not None:
            raise InputError(f"depth images go with a folder of images; {self.path} is a video")
        if not self.path.is_file():
            raise InputError(f"{self.path} does not exist; give a folder of images or a video")
        chosen, used = self.selection or SelectionOptions(), self._camera_mask()
        mask = b"" if used is None else used.tobytes()
        work = begun.on(file_format.file_hash(self.path), rigs.fingerprint(self.rig), chosen, mask)
        folder = work.stage(
            FRAMES, lambda new: video.extract(self.path, self.rig, new, chosen, used=used, progress=progress)
        )
        read = read_folder(folder, self.rig, masks=self.masks, progress=progress)
        return dataclasses.replace(read, notes=video.notes(self.path))

    def _camera_mask(self) -> np.ndarray | None:
        """The mask that the first camera has for all its images."""
        camera = self.rig.cameras[0]
        path = masks.of_camera(self.masks, camera) if self.masks is not None else None
        return None if path is None else masks.read(path, camera)


def require_usable(work: Work, images: ImageSet, *, progress: Progress = silent) -> None:
    """Examine the images, as a stage of the work.

    Raises:
        InputError: folders are exchanged: no map of them can be right.
    """

    def examine(folder: Path) -> None:
        found = examination.examine(images, progress=progress)
        (folder / "check.json").write_text(json.dumps(found.as_dict()))

    found = json.loads((work.stage(CHECK, examine) / "check.json").read_text())
    if found["exchanged"]:
        raise InputError(f"{images.folder}: {found['problems'][-1]}")
