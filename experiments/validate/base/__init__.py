"""What cases of the verification suite are made of: cases, bands, parts that are kept, the document.

Imports `coupling.lammps`, `dem`, `experiments.runs`.
"""
