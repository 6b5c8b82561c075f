"""What every experiment shares: the run folder, progress, reading of settings, resuming, the result.

Imports `dem`, `rigid`, `vis`.
"""
