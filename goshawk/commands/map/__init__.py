"""Cameras, maps, and places in them."""
