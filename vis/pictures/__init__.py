"""vis/pictures."""
