"""Effects on the sensors, applied in `rigid.sensors`: one file an effect.

Imports `rigid.terms`.
"""
