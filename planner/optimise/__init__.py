"""From a route to the fastest path along it."""
