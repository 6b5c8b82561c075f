"""experiments/bed."""
