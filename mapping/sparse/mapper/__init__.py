"""Incremental mapping with COLMAP: pairs, growth, what disagrees, what has no place."""
