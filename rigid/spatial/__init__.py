"""A platform in space: six degrees of freedom, three flywheels (`spatial` is the entry, `steps` the integrator).

Imports `rigid.checks`, `rigid.ground`, `rigid.platform`.
"""
