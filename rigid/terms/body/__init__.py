"""Effects on the platform, its rig, cable and motor: one file an effect.

Imports `rigid.terms`.
"""
