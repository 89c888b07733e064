"""The vehicle's side door: the embedded controller, the link to it, and a virtual vehicle that runs both."""
