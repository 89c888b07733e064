"""Lenses and rigs from the images themselves: a first guess, self-calibration, the calibration on trial."""
