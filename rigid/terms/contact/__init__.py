"""Effects at the contact with the ground: one file an effect.

Imports `rigid.terms`.
"""
