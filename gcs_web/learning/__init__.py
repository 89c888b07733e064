"""The vehicle's model as people work on it: diagnosis, changes tried and kept, the user's own effects."""
