"""The contact law: forces of a contact, cohesion, and the time step that resolves it.

Imports `dem.grains`.
"""
