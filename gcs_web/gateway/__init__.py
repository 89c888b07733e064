"""The only way in: the gateway, its certificate, and the people who have the page open."""
