"""Which flight to fly next, rehearsed in simulation."""
