"""vis/page."""
