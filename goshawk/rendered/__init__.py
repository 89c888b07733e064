"""A simulated room, its images, and how far a map of it is off: for the demo, the tests and the benchmarks."""
