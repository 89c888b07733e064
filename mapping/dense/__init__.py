"""Images with poses to depth, a distance volume and a mesh."""
