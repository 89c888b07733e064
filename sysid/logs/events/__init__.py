"""What happened during a recording: each stream's clock, and its values against a second sensor, as one table."""
