"""Recorded motion beside the poses of images: same flight, same time, where the camera sits."""
