"""What the pilots edit together, how it lasts, and the files that other programs read of it."""
