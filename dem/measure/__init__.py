"""Tests on a bed: cone, shear, repose, vertical cut, element, grading.

Imports `dem.contact`, `dem.engine`, `dem.grains`, `dem.shapes`.
"""
