"""Effects on the thrust of each rotor."""
