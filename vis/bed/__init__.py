"""vis/bed."""
