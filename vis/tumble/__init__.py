"""The report of a tumble in the plane: path, states, energy, tracks, film.

Imports `vis.film`, `vis.page`, `vis.pictures`, `vis.view`.
"""
