"""Effects on the platform, its rig, cable and motor: one file an effect. They import nothing but leaves of
`rigid.terms`.
"""
