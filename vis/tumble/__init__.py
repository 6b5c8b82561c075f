"""vis/tumble."""
