"""The vehicle and the ground station."""
