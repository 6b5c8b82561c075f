"""The report of a platform in space.

Imports `vis.film`, `vis.page`, `vis.pictures`, `vis.view`.
"""
