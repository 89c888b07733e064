"""What is asked for: waypoints, conditions, options, and the space to fly in."""
