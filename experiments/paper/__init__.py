"""The trials of Reid, Roveda, Nesnas and Pavone (i-SAIRAS 2014) beside what the paper states.

Imports `experiments.tumble` and what that may import.
"""
