"""Simulated flights: the integrator, the manoeuvres, a tracking controller, sensors, and what a flight can identify."""
