"""The report of a sweep: what came out over what was varied, and sensitivities.

Imports `rigid`, `vis.page`.
"""
