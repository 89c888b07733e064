"""Point clouds of other programs."""
