"""Diagnosis of pushes and drops of a spike.

Imports `experiments.campaign`, `experiments.check`, `experiments.diagnose.core`, `experiments.diagnose.fit`,
`experiments.diagnose.noise`, `experiments.grains`, `rigid`.
"""
