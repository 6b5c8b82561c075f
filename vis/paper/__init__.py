"""Reports of the paper's figures and of hops, and a sketch of the model.

Imports `rigid`, `vis.page`, `vis.pictures`.
"""
