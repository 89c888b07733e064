"""The vehicle: what it says, orders to it, its compensation, and its place in the 3D view."""
