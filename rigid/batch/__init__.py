"""Thousands of planar trials at once, compiled by Taichi (`simulate`); `kernel` has the integrator.

Imports `rigid.checks`, `rigid.model`, `rigid.planar`, `rigid.terms`.
"""
