"""vis/paper."""
