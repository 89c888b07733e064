"""The project folder, the demo and this installation."""
