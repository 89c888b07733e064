"""Fits to flights without a pose: what gyro and accelerometer show beside what drives the rotors."""
