"""A hop: the wheel speed or torque for a distance, on rigid ground and on ground that gives.

Imports `experiments.tumble` and what that may import.
"""
