"""vis/spatial."""
