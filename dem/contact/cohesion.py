"""Cohesion: DMT and JKR, both as functions of the present overlap alone.

gamma is the surface energy of a pair [J/m2]: half its work of adhesion w = 2 gamma. For two like grains it is the
material's own; for unlike ones sqrt(gamma_1 gamma_2) is usual (Israelachvili 2011, section 17.3).

DMT (Derjaguin, Muller & Toporov 1975, J. Colloid Interface Sci. 53:314), for small and stiff grains:
    F = 4/3 E* sqrt(R*) d^1.5 - 2 pi w R*,  d > 0;  pull-off 2 pi w R* = 4 pi gamma R*, where the surfaces part.
JKR (Johnson, Kendall & Roberts 1971, Proc. R. Soc. A 324:301), for large and soft ones:
    F = 4 E* a^3 / (3 R*) - sqrt(8 pi w E* a^3),  d = a^2 / R* - sqrt(2 pi w a / E*);
    pull-off 3/2 pi w R* = 3 pi gamma R*, at a negative overlap.

With a_1^3 = 2 pi w R*^2 / E* and s = sqrt(a / a_1), JKR's law is one curve for all pairs:
    d R* / a_1^2 = s^4 - s,  F = pi w R* (8/3 s^6 - 4 s^3),
which is solved for s by Ferrari's formula. It ends at s^3 = 1/4, where the overlap is least: the pair's *range* below
zero, 3/4 4^(-1/3) a_1^2 / R*. Approach and separation follow the same function of the overlap. So separation needs no
history, and pairs attract one another from the range on, before they touch. The energy that real surfaces lose by
jumping into contact is left out (docs/bed.md).
"""

import math

from hedgebed_taichi import ti

__all__ = ["COHESIONS", "DMT", "JKR", "jkr_contact", "jkr_force", "jkr_range", "jkr_reach", "pull_off"]

NO_COHESION, DMT, JKR = range(3)
COHESIONS = {"none": NO_COHESION, "dmt": DMT, "jkr": JKR}  # The laws by name

# -(s^4 - s) where it is least.
_RANGE = 0.75 * 0.25 ** (1 / 3)


def pull_off(law: str, *, surface_energy: float, radius: float) -> float:
    """Pull-off force [N] of a pair of effective radius R* [m]; 0 for "none". Raises KeyError: an unknown law."""
    factor = {"none": 0.0, "dmt": 2.0, "jkr": 1.5}[law]
    return factor * math.pi * (2 * surface_energy) * radius


def jkr_range(*, surface_energy: float, radius: float, effective_young: float) -> float:
    """How far apart the surfaces of a JKR pair are when it parts [m]."""
    return _RANGE * (2 * math.pi * (2 * surface_energy) / effective_young) ** (2 / 3) * radius ** (1 / 3)


def jkr_contact(overlap: float, *, surface_energy: float, radius: float, effective_young: float) -> tuple[float, float]:
    """Contact radius [m] and force [N] of a JKR pair at rest. Raises ValueError: it has parted at this overlap [m]."""
    w = 2 * surface_energy
    unit = (2 * math.pi * w * radius**2 / effective_young) ** (1 / 3)
    d = overlap * radius / unit**2
    if d < -_RANGE:
        raise ValueError(f"overlap = {overlap} m: a JKR pair parts at {-_RANGE * unit**2 / radius:.4g} m")
    u = math.cbrt(1 / 16 + math.sqrt(max(0.0, 1 / 256 + d**3 / 27)))
    m = u - d / (3 * u)
    if d > 0:
        m = 0.125 / (m * m + d)
    s = 0.5 * (math.sqrt(2 * m) + math.sqrt(max(0.0, 2 / math.sqrt(2 * m) - 2 * m)))
    return unit * s**2, math.pi * w * radius * (8 / 3 * s**6 - 4 * s**3)


@ti.func
def jkr_reach(two_e, pi_w, radius):
    """``jkr_range`` in a kernel: ``two_e`` 2 E* [Pa], ``pi_w`` pi w [J/m2]."""
    ratio = 4.0 * pi_w / two_e
    return _RANGE * (ratio * ratio * radius) ** (1.0 / 3.0)


@ti.func
def jkr_force(two_e, pi_w, overlap, radius):
    """``jkr_contact`` in a kernel: contact radius [m] and force [N]; Hertz's where ``pi_w`` is 0."""
    a = ti.sqrt(radius * ti.max(overlap, 0.0))
    f = (2.0 / 3.0) * two_e * a * overlap
    if pi_w > 0.0:
        unit = (4.0 * pi_w * radius * radius / two_e) ** (1.0 / 3.0)
        d = overlap * radius / (unit * unit)
        u = (0.0625 + ti.sqrt(ti.max(0.0, 0.00390625 + d * d * d / 27.0))) ** (1.0 / 3.0)
        # The resolvent's root, m^3 + d m = 1/8; for d > 0 the difference loses digits and one more turn finds them.
        m = u - d / (3.0 * u)
        if d > 0.0:
            m = 0.125 / (m * m + d)
        root = ti.sqrt(2.0 * m)
        s = 0.5 * (root + ti.sqrt(ti.max(0.0, 2.0 / root - 2.0 * m)))
        cube = s * s * s
        a = unit * s * s
        f = pi_w * radius * ((8.0 / 3.0) * cube - 4.0) * cube
    return a, f
