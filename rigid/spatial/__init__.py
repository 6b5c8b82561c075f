"""A platform in space: six degrees of freedom, three flywheels (`spatial` is the entry, `steps` the integrator).

May import `platform`, `ground`.
"""
