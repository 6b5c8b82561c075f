"""Similar motions under any gravity: Froude number and inertial number of a tip in grains.

Grains without cohesion are the same problem under any gravity g if lengths are kept, times scale with 1 / sqrt(g) and
moduli with g. The similarity parameter is the Froude number v / sqrt(g D) of a tip of diameter D; it is small for
quasi-static motion. The inertial number d (dv/dz) / sqrt(P / rho) (GDR MiDi 2004, Eur. Phys. J. E 14:341) compares the
time in which a grain of diameter d falls into a gap with the time of the shear: here dv/dz = v / D, and P = phi rho g D
is the weight of the grains above a depth of D, so that I = Fr (d / D) / sqrt(phi).

On a tip's area the force of inertia is lambda rho_b v^2, and the static force at the depth D is xi_n D (3D-RFT, see
`experiments.grains.softening`). Their ratio is lambda Fr^2 / (xi_n / rho_b g): `inertia_share`.
"""

import math

from .softening import INERTIA, PACKING, bearing_gradient

__all__ = ["FAR", "froude", "inertia_share", "inertial_number", "quasi_static_speed"]

FAR = 0.1
"""Share of the static force from which on inertia counts as large [1]: a Froude number of 2.2 at a friction of 0.5."""


def froude(speed: float, *, gravity: float, diameter: float) -> float:
    """v / sqrt(g D) of a tip of `diameter` [m] at `speed` [m/s] [1]."""
    return speed / math.sqrt(gravity * diameter)


def inertial_number(speed: float, *, gravity: float, diameter: float, grain: float) -> float:
    """The inertial number of grains of diameter `grain` [m] that a tip shears at the depth of its diameter [1]."""
    return froude(speed, gravity=gravity, diameter=diameter) * grain / diameter / math.sqrt(PACKING)


def inertia_share(speed: float, *, gravity: float, diameter: float, friction: float) -> float:
    """Force of inertia over the static force at the depth of a tip's diameter [1]; `friction` of two grains."""
    static = bearing_gradient(1.0, 1.0, friction)
    return INERTIA * froude(speed, gravity=gravity, diameter=diameter) ** 2 / static


def quasi_static_speed(*, gravity: float, diameter: float, friction: float) -> float:
    """The speed at which `inertia_share` is `FAR` [m/s]."""
    return math.sqrt(FAR * bearing_gradient(1.0, 1.0, friction) * gravity * diameter / INERTIA)
