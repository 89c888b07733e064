"""The calibration of the cameras on trial: what may be wrong with it, and what the matches of a map say of that."""
