"""Grains under a platform or a spike: the bed's size and preparation, softening, the run on it.

Imports `coupling`, `dem`, `experiments.platform`, `experiments.runs`, `rigid`, `vis`.
"""
