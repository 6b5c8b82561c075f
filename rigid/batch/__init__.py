"""Thousands of planar trials at once, compiled by Taichi (`simulate`); `kernel` has the integrator.

May import `model`, `planar`, `terms`, `ground`.
"""
