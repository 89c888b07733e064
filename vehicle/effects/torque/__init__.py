"""Torques on the body, once thrust is known."""
