"""The report that sets two runs side by side.

Imports `rigid`, `vis.film`, `vis.page`, `vis.pictures`.
"""
