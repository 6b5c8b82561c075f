"""experiments/diagnose/noise."""
