"""experiments/runs."""
