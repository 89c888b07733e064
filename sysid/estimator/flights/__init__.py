"""Flights made ready for the estimator: nodes in time, their readings, their clocks."""
