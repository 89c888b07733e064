"""The web ground station: a project's map, waypoints and plan on one page, behind a gateway that requires a token."""

from gcs_web.app import GroundStation

__all__ = ["GroundStation"]
