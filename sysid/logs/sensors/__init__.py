"""What lay between a sensor and its log."""
