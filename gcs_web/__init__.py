"""The web ground station: a project's map, waypoints and plan on one page, behind a gateway that requires a token."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gcs_web.app import GroundStation

__all__ = ["GroundStation"]


def __getattr__(name: str) -> Any:
    """The station when it is asked for: its processes for plans and jobs import parts of this package alone."""
    if name != "GroundStation":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from gcs_web.app import GroundStation

    return GroundStation
