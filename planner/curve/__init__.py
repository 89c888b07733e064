"""The curve that is flown, its heading, and the attitude that follows from it."""
