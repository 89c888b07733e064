"""`goshawk preflight` and `goshawk preflight batch`: a plan flown many times in simulation, its result and its page."""
