"""experiments/diagnose/push."""
