"""Cases of the verification suite on single contacts and clouds of grains.

Imports `dem`, `experiments.runs`, `experiments.validate.base`, `vis.page`.
"""
