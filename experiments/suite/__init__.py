"""The cases on grains that ship: what each costs, which have a result; running the rest.

Imports `coupling`, `dem`, `experiments.grains`, `experiments.pool`, `experiments.runs`, `experiments.tumble`, `rigid`.
"""
