"""Vehicles of other programs: PX4, RotorPy, URDF."""
