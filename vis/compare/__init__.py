"""vis/compare."""
