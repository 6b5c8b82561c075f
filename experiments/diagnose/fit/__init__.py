"""experiments/diagnose/fit."""
