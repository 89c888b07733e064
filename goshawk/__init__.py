"""The roof: the command line, and the demo that runs every room once."""
