"""Recorded flights: the list, their streams over time, and how their clocks are moved to stand side by side."""
