"""Whose recorded flights stand in the one 3D view, and whether the plan stands there too, where several people look.

Nobody's step takes anything out of another person's view: the flights that were asked for last stand there until that
person looks elsewhere, then those of another who still looks at some; the plan is set aside only while everybody looks
at flights.
"""

import threading
from collections.abc import Callable

from flight import FlightError
from gcs_web.comparison.comparing import Comparing
from gcs_web.comparison.flight_scene import FlightScene
from gcs_web.gateway.hub import Hub
from gcs_web.protocol.comparison import FlightMoment, FlightsShown, ShowFlights, Stretch

_NONE = ShowFlights(serial=0, flights=[])


class ShownFlights:
    """Thread-safe."""

    def __init__(
        self, hub: Hub, comparing: Comparing, scene: FlightScene, set_plan_aside: Callable[[bool], None]
    ) -> None:
        self._hub, self._comparing = hub, comparing
        self._scene, self._set_plan_aside = scene, set_plan_aside
        self._lock = threading.RLock()
        self._wanted: dict[str, ShowFlights] = {}
        """By person who looks at flights; who asked last is the last."""
        self._shown = FlightsShown()
        scene.on_moment = self._clicked

    def show(self, person: str, wanted: ShowFlights) -> None:
        """Draw flights for a person (id); none: that person does not look at flights any more.

        Raises:
            FlightError: a flight cannot be read.
        """
        with self._lock:
            self._wanted.pop(person, None)
            if not wanted.flights:
                self._draw_newest()
                return
            self._wanted[person] = wanted
            try:
                self._draw(person, wanted)
            except FlightError:
                del self._wanted[person]
                self._draw_newest()
                raise

    def look(self, person: str, time_s: float | None) -> None:
        """Move the vehicles to a moment, if it is this person's flights that stand there."""
        with self._lock:
            if person == self._shown.author:
                self._scene.look(time_s)

    def mark(self, person: str, stretches: list[Stretch]) -> None:
        """Mark parts of the paths, if it is this person's flights that stand there."""
        with self._lock:
            if person == self._shown.author:
                self._scene.mark([(each.flight, each.from_s, each.to_s) for each in stretches])

    def people_changed(self) -> None:
        """Somebody came or went: whoever came begins with the plan, and what only the one who went saw goes."""
        with self._lock:
            present = {person.id for person in self._hub.people}
            gone = self._wanted.keys() - present
            for person in gone:
                del self._wanted[person]
            if self._shown.author in gone:
                self._draw_newest()
            else:
                self._tell(self._shown)

    def _draw_newest(self) -> None:
        while self._wanted:
            person, wanted = next(reversed(self._wanted.items()))
            if person == self._shown.author:
                self._tell(self._shown)
                return
            try:
                self._draw(person, wanted)
                return
            except FlightError:  # discarded since: that page is told by the list of flights
                del self._wanted[person]
        self._draw("", _NONE)

    def _draw(self, person: str, wanted: ShowFlights) -> None:
        arrows, reach = self._comparing.draw(wanted)
        if person != self._shown.author:
            self._scene.mark([])  # its page sends its own
        self._tell(FlightsShown(person, wanted.flights, arrows, reach))

    def _tell(self, shown: FlightsShown) -> None:
        everybody = all(person.id in self._wanted for person in self._hub.people)
        self._set_plan_aside(bool(shown.flights) and everybody)
        self._shown = FlightsShown(
            shown.author, shown.flights, shown.arrows, shown.colour_reach, bool(shown.flights) and not everybody
        )
        self._hub.publish(self._shown)

    def _clicked(self, time_s: float) -> None:
        with self._lock:
            self._scene.look(time_s)
            self._hub.publish(FlightMoment(time_s), self._shown.author)
