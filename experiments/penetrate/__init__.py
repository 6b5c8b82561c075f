"""experiments/penetrate."""
