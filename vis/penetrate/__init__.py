"""The report of a spike in a bed: drag, drops, sinkage.

Imports `rigid`, `vis.page`, `vis.pictures`, `vis.view`.
"""
