"""The messages on the link: XML definitions, their generator, and what it generated."""
