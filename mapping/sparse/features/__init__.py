"""Features of images: found, kept on disk, matched, and where they repeat."""
