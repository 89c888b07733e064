"""A way round obstacles, before anything is known of how it is flown."""
