"""Grains under a platform: the bed's size and preparation, the stiffness of its grains, the run on it.

`on_bed` holds what a run in the plane and one in space have in common. Imports `experiments.runs` and `platform`,
`coupling`, `dem`, `rigid` and `vis`; loading it loads Taichi where a module needs a bed.
"""
