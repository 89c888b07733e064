"""What the 3D view shows of a map's file: from a cache beside the document, or made anew in a process of its own."""

from pathlib import Path

from flight import MapError, Progress
from gcs_web.jobs.job_process import Failed, JobProcess, Work
from gcs_web.scene import tiles
from gcs_web.scene.tiles import Tiles


def load_or_make(cache: Path, key: str, source: Path, make: Work, asked: object, progress: Progress) -> Tiles:
    """
    Args:
        cache: file in which `make`, given its folder and what is `asked`, writes the tiles under this `key`.
        source: of the tiles, for the message.

    Raises:
        MapError: they cannot be made; the message says why.
    """
    shown = tiles.load(cache, key)
    if shown is None:
        cache.parent.mkdir(parents=True, exist_ok=True)
        made = JobProcess(make, cache.parent, asked, cache.with_suffix(".log")).outcome(progress)
        if isinstance(made, Failed):
            raise MapError(made.reason)
        shown = tiles.load(cache, key)
    if shown is None:
        raise MapError(f"{source.name} could not be prepared for display; see {cache.with_suffix('.log')}")
    return shown
