"""Effects on the sensors, applied in `rigid.sensors`: one file an effect. They import nothing but leaves of
`rigid.terms`.
"""
