"""Fitted models against flights: prediction error, residual force and torque, what a change brings."""
