"""experiments/diagnose/core."""
