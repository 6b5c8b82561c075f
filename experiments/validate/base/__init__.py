"""experiments/validate/base."""
