"""Files of each kind to one table, and first column maps of foreign ones."""
