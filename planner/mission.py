"""A mission as one trajectory: a way in, laps, stays at waypoints and a way out, joined without a jump."""

from flight.trajectory import join

__all__ = ["join"]
