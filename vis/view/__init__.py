"""Pages on which a run can be turned, zoomed and moved through time; small ones inside reports.

Imports `rigid`, `vis.film`, `vis.page`, `vis.pictures`.
"""
