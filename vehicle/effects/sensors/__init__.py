"""Errors of sensors: what they report, not what the vehicle does."""
