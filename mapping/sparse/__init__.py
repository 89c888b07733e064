"""Images to metric poses and points."""
