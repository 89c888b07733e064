"""Effects on mass, inertia and centre of mass."""
