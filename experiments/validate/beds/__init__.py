"""experiments/validate/beds."""
