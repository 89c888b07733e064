"""What flights say about candidate effects and free curves: scores, held-out costs."""
