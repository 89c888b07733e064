"""Vehicles of other programs: PX4, ArduPilot, Betaflight, RotorPy, URDF, MJCF, drone-models."""
