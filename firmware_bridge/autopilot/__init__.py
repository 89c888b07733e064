"""Plans on PX4 and ArduPilot by MAVLink. Not run on either: only on a simulated one of the tests."""
