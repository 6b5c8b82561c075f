"""vis/penetrate."""
