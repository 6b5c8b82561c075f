"""Reports of the paper's figures and of hops.

Imports `vis.page`.
"""
