"""What is known of motors before any check: their commands as speeds, and where a firmware has them."""
