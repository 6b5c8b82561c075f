"""experiments/calibrate."""
