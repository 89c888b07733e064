"""Recorded flights beside plan and model: what is left unexplained, as numbers and in the 3D view."""
