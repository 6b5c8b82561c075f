"""What a residual is made of besides a missing effect: coloured noise, jitter, stuck sensors, scatter of replicates.

Imports `experiments.check`, `experiments.diagnose.fit`, `experiments.grains`, `vis.page`.
"""
