"""Two finished runs in one report: numbers with differences, what both did over time.

Imports `experiments.spatial` and what that may import.
"""
