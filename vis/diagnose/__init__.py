"""Reports of a diagnosis, of a campaign and of the check of one.

Imports `rigid`, `vis.page`.
"""
