"""experiments/diagnose/report."""
