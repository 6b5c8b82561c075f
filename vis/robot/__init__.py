"""The report of a robot of MuJoCo.

Imports `vis.film`, `vis.page`, `vis.pictures`, `vis.spatial`, `vis.view`.
"""
