"""vis/diagnose."""
