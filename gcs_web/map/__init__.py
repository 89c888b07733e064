"""The map in the 3D view: its mesh, points and slices, measuring, and previews of edits."""
