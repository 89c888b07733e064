"""The states of a flight, and the vehicle's acceleration along them."""
