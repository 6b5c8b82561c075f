"""The platform and the spike: geometry, mass, wheels, the rig, and files that describe a platform.

Imports `rigid.checks`.
"""
