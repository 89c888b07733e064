"""Written by dialect/generate.py."""
