"""One module per verb; each exports `command`."""
