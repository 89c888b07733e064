"""Effects of wind, ground and ceiling."""
