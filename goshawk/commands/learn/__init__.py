"""Flight logs, the vehicle model, and what it lacks."""
