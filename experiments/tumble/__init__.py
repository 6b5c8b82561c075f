"""A tumble in the plane: on the spring-damper or a law, over a range, on grains; campaigns made of tumbles.

Imports `experiments.runs`, `campaign`, `platform` and `grains`, and what those may import.
"""
