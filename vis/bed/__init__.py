"""Reports of beds, of tests of their strength, of a calibration and of the verification suite.

Imports `rigid`, `vis.page`, `vis.pictures`, `vis.view`.
"""
