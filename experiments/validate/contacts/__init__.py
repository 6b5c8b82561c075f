"""experiments/validate/contacts."""
