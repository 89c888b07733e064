"""What viser is given to draw: lines, vehicles, tiles; and what a click on them means."""
