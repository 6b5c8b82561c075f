"""The report that sets two runs side by side.

Imports `vis.film`, `vis.page`, `vis.pictures`, `vis.tumble`.
"""
