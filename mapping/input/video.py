"""A video as a folder of images: the frames that are worth mapping, with their times."""

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flight import FloatArray, InputError, Progress, errors, file_format, silent
from mapping.camera.rig import Camera, Rig
from mapping.input import selection
from mapping.input.selection import SelectionOptions

if TYPE_CHECKING:
    import cv2

SUFFIXES = (".mp4", ".mov", ".avi", ".mkv", ".m4v", ".webm", ".mpg", ".mpeg", ".ts", ".mts", ".360")
_MISSING = 0.02
"""Share of the frames that the file announces and that may be missing: some recorders announce a few too many."""
_LEAST_CHOSEN = 2


@dataclass(frozen=True, slots=True, eq=False)
class _Frame:
    time_s: float
    """Its own time stamp: the rate may vary."""
    pixels: np.ndarray
    """(height, width, 3) BGR."""


def is_video(path: Path) -> bool:
    """Whether a path is taken for a video: by its suffix, as an image folder has none."""
    return path.suffix.lower() in SUFFIXES and not path.is_dir()


def extract(
    video: Path,
    rig: Rig,
    folder: Path,
    options: SelectionOptions,
    *,
    used: np.ndarray | None = None,
    progress: Progress = silent,
) -> None:
    """Write the chosen frames and `times.csv` into an existing folder.

    Args:
        rig: of one camera.
        used: (height, width) bool: pixels that are not masked.

    Raises:
        InputError: it is no video that can be decoded, is cut off, of another size than the camera's images, or shows
            nothing that moves.
    """
    if len(rig) > 1:
        raise InputError(f"a video is of one camera; the camera file has {len(rig)}: give a folder of images for a rig")
    camera = rig.cameras[0]
    times_s: list[float] = []

    def grays() -> Iterator[np.ndarray]:
        import cv2

        for frame in _frames(video, camera, "choosing frames", progress):
            times_s.append(frame.time_s)
            yield cv2.cvtColor(frame.pixels, cv2.COLOR_BGR2GRAY)

    chosen = selection.choose(grays(), camera, options, used=used)
    _require_times(video, np.array(times_s))
    if len(chosen) < _LEAST_CHOSEN:
        raise InputError(f"{video}: the camera hardly moves in its {len(times_s)} frames; a map needs parallax")
    _write(video, camera, folder, chosen, times_s, progress)


def notes(video: Path) -> tuple[str, ...]:
    """What was not done in reading it: its orientation tag turns no pixels."""
    import cv2

    capture = _opened(video)
    turned_deg = capture.get(cv2.CAP_PROP_ORIENTATION_META) % 360.0
    capture.release()
    if not turned_deg:
        return ()
    return (f"the video's tag asks to turn it by {turned_deg:.0f} deg; pixels are taken as they are stored",)


def _opened(video: Path) -> "cv2.VideoCapture":
    import cv2

    capture = cv2.VideoCapture(str(video), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, 1])
    capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0.0)
    return capture


def _frames(video: Path, camera: Camera, stage: str, progress: Progress) -> Generator[_Frame]:
    """All frames, one after the other."""
    import cv2

    if not video.is_file():
        raise errors.missing(video, "a video")
    capture = _opened(video)
    try:
        if not capture.isOpened():
            raise InputError(
                f"{video} cannot be opened as a video: it is damaged, cut off (an MP4 has its index at the end), or of "
                "an unknown codec. Convert it: ffmpeg -i VIDEO -c:v libx264 -crf 18 NEW.mp4"
            )
        announced = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        read = 0
        while True:
            met, pixels = capture.read()
            if not met:
                break
            if (pixels.shape[1], pixels.shape[0]) != (camera.width, camera.height):
                tag = "".join(f" as stored ({note})" for note in notes(video))
                raise InputError(
                    f"{video} has frames of {pixels.shape[1]}x{pixels.shape[0]} pixels{tag}; camera {camera.name!r} of "
                    f"the camera file has {camera.width}x{camera.height}; use the camera file of this video"
                )
            read += 1
            yield _Frame(capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0, np.asarray(pixels, dtype=np.uint8))
            progress(stage, min(read / max(announced, read), 1.0))
    finally:
        capture.release()
    if not read:
        raise InputError(f"{video} has no frame that can be decoded: it is empty, damaged, or of an unknown codec")
    if announced > 0 and read < (1.0 - _MISSING) * announced - 1:
        raise InputError(
            f"{video} ends after frame {read} of {announced}: it is cut off or damaged there; copy it again, or keep "
            "the whole part: ffmpeg -i VIDEO -c copy NEW.mp4"
        )
    progress(stage, 1.0)


def _require_times(video: Path, times_s: FloatArray) -> None:
    steps_s = np.diff(times_s)
    if len(steps_s) and not (steps_s > 0.0).all():
        frame = int(np.flatnonzero(steps_s <= 0.0)[0]) + 1
        raise InputError(
            f"{video}: the time of frame {frame} ({times_s[frame]:.3f} s) is not after that of the frame before "
            f"({times_s[frame - 1]:.3f} s); its time stamps are damaged: "
            "ffmpeg -i VIDEO -vf setpts=N/FRAME_RATE/TB NEW.mp4"
        )


def _write(
    video: Path, camera: Camera, folder: Path, chosen: list[int], times_s: list[float], progress: Progress
) -> None:
    import cv2

    (folder / camera.folder).mkdir(parents=True, exist_ok=True)
    wanted, rows = set(chosen), ["image,time_s"]
    for number, frame in enumerate(_frames(video, camera, "writing frames", progress)):
        if number in wanted:
            name = f"{number:06d}.png"
            written = cv2.imencode(".png", frame.pixels, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1]
            (folder / camera.folder / name).write_bytes(written.tobytes())
            rows.append(f"{name},{times_s[number]:.6f}")
    file_format.write_bytes(folder / "times.csv", "\n".join([*rows, ""]).encode())
