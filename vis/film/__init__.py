"""vis/film.

Imports `vis.page`, `vis.pictures`.
"""
