"""Grains before they move: materials, size distributions, first positions and profiles.

Imports nothing of ours.
"""
