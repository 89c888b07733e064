"""How the inner loop turns the vehicle."""
