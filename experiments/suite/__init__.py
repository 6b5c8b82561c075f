"""The cases on grains that ship: what each costs, which have a result; running the rest.

Imports `experiments.tumble` and what that may import.
"""
