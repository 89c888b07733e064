"""Trajectories: planned, checked, exported."""
