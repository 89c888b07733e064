"""Maps for other programs: meshes and points, a COLMAP model, an OctoMap."""
