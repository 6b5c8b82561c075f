"""The engine: fields, kernels, neighbour lists, sleep, checkpoints, and the core of a bed.

Imports `dem.contact`, `dem.files`, `dem.gpu`, `dem.grains`, `dem.shapes`.
"""
