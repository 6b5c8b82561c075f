"""experiments/diagnose/tumble."""
