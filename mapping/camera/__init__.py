"""The camera file: lenses, rigs, importers and exporters, and the file on trial."""
