"""The report of a spike in a bed: drag, drops, sinkage.

Imports `vis.page`, `vis.pictures`, `vis.view`.
"""
