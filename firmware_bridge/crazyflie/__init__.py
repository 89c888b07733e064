"""Plans on a Crazyflie by its own protocol, CRTP. Not run on one: only on a simulated one of the tests."""
