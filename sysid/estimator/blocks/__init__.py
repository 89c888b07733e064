"""Residual blocks of the estimator, one file each, and the inputs that drive its model."""
