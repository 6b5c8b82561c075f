"""Shapes of bodies: distances to them, as data and as Taichi functions.

Imports nothing of ours.
"""
