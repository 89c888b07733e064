"""The final gate: what every trajectory must pass before it leaves the planner."""
