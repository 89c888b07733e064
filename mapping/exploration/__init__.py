"""Where to look again: unknown space that is worth it, and the views that would show it."""
