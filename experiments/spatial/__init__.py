"""A platform in six degrees of freedom on the spring-damper or on grains.

Imports `experiments.tumble` and what that may import.
"""
