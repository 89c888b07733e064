"""Residual blocks of the estimator, one file each, and their noise levels."""
