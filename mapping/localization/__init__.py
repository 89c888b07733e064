"""New images in a known map."""
