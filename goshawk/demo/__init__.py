"""The demo: the whole chain on the rendered room."""
