"""Betaflight's real firmware for the simulator (SITL), and a body for it to fly."""
