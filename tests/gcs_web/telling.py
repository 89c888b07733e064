"""A vehicle that a station tells of again and again: said once, its page takes the station for lost after 3 s."""

import contextlib
import threading
from collections.abc import Iterator

from gcs_web import GroundStation
from gcs_web.protocol.vehicle import Vehicle


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
