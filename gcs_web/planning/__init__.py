"""The plan of the document, made in a process of its own, and what it is checked against."""
