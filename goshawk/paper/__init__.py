"""What Rigter et al. (2019) showed, done again: their vehicle identified, flown, and sent along a planned path."""
