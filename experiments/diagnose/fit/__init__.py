"""Fits of a model to trials: least squares, likelihoods, evidence, the gate against false alarms.

Imports `experiments.check`, `experiments.runs`, `rigid`, `vis`.
"""
