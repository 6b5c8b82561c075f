"""The preparation of beds: stages, recipes, reports, the cache and bed files.

Imports `dem.contact`, `dem.engine`, `dem.files`, `dem.grains`, `dem.measure`.
"""
