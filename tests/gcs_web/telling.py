"""A station without a map and a vehicle, which tells its pages of one again and again: said once, they take the station
for lost after 3 s."""

import contextlib
import threading
from collections.abc import Iterator
from pathlib import Path

from flight import project
from gcs_web import GroundStation
from gcs_web.protocol.vehicle import Vehicle


@contextlib.contextmanager
def empty_station(folder: Path) -> Iterator[GroundStation]:
    """Of an empty project, and without a vehicle: the tests tell the page of one."""
    opened = project.create(folder / "hall", "hall")
    with GroundStation(opened.folder, triangles=500) as running:
        yield running


@contextlib.contextmanager
def telling(station: GroundStation, vehicle: Vehicle) -> Iterator[None]:
    """Five times a second."""
    over = threading.Event()

    def repeat() -> None:
        while True:
            station.hub.publish(vehicle)
            if over.wait(0.2):
                return

    thread = threading.Thread(target=repeat)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
