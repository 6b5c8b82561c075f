"""The time step, from the contact time; and how stiff grains must be for an overlap bound.

All formulas are Hertz's (Johnson 1985, chapters 4 and 11), with the smallest grain of the bed. d is its diameter.

How long a step may be. In a lattice of like grains, each with z neighbours at one overlap, what swings fastest obeys
the step of ``dem.contact.law`` linearised. With x the change of a contact's overlap, v its rate half a step before,
f its force, in units of m*, S_n and w = sqrt(S_n / m*); q = w dt, c the damping factor, N = z / 3:
    v' = v + q N f,  x' = x + q v',  (1 + q c / 2) f' = -x' - c (3/2 v' - v / 2 - q f / 2).
An eigenvalue comes to -1 where N q^2 + 4 (N - 1) c q = 4. Alone (N = 1) a pair is stable up to q = 2 with any damping,
as its own force is solved for. What the neighbours do is seen half a step late, which gives the term 4 (N - 1) c q.
Where contacts stick, spins of one sense are stiffer: each contact slips at twice r times the spin, against S_t = K S_n
and a dashpot that sees the half-step velocity. There 5/3 z (K q^2 + 2 c sqrt(K) q) = 4, K = 2 (1 - nu) / (2 - nu).
"""

import math

from dem.grains.materials import Material

from .cohesion import jkr_contact
from .law import damping_factor, effective_moduli

__all__ = ["CHAIN", "choose_young", "contact_time", "longest_step", "stable_step", "time_step_for"]

STEPS_PER_CONTACT = 8
FEWEST_STEPS_PER_CONTACT = 5
# All at the overlap bound: as many as like spheres can have; and, of those that stick, what a dense bed of rough grains
# has in the mean.
NEIGHBOURS, STICKING_NEIGHBOURS = 12, 6
_SHEAR_RATIO = 6 / 7  # K at nu = 1/4; from 1 at 0 to 2/3 at 1/2
# The half-period of two grains over that of a grain on a rigid plane, which is the contact time.
_PAIR = 2**0.25
# The largest of some hundred loaded contacts over their mean: a drive to 20 mm in sand measured 3.4.
CHAIN = 4.0


def contact_time(material: Material, *, diameter: float, max_overlap: float) -> float:
    """Half a period of the stiffest contact that the overlap bound allows [s].

    It is pi sqrt(m* / S_n), S_n = 2 E* a with a = sqrt(R* delta) (or JKR's) at delta = max_overlap d. Of two grains and
    a grain on a rigid plane the shorter time counts. A Hertzian collision that reaches this overlap lasts 1.28 times as
    long, and one that reaches a tenth of it 2.3 times.

    ``diameter``: of the smallest grain [m]; ``max_overlap``: overlap over diameter [1].
    """
    mass = material.density * math.pi * diameter**3 / 6
    delta = max_overlap * diameter
    times = []
    for other, radius, reduced in ((material.young, diameter / 4, mass / 2), (math.inf, diameter / 2, mass)):
        young, _ = effective_moduli(material.young, material.poisson, other, material.poisson)
        a = math.sqrt(radius * delta)
        if material.cohesion == "jkr":
            a, _ = jkr_contact(delta, surface_energy=material.surface_energy, radius=radius, effective_young=young)
        times.append(math.pi * math.sqrt(reduced / (2 * young * a)))
    return min(times)


def stable_step(restitution: float, *, neighbours: float = NEIGHBOURS, sticking: bool = False) -> float:
    """The longest stable step of a lattice of like grains, over the half-period pi sqrt(m* / S_n) of its contacts [1].

    See the module. The damping is that of ``damping_factor``, whose ValueError it raises.

    Args:
        neighbours: z, of each grain, in all directions alike; 3 is a pair alone.
        sticking: with friction's springs, for spins of one sense; without, for the normal forces.
    """
    c, n = damping_factor(restitution), neighbours / 3
    # a q^2 + 2 b q = 4
    a, b = n, 2 * c * (n - 1)
    if sticking:
        a, b = 5 * n * _SHEAR_RATIO, 5 * n * c * math.sqrt(_SHEAR_RATIO)
    return 4 / (b + math.sqrt(b * b + 4 * a)) / math.pi


def longest_step(material: Material, *, diameter: float, max_overlap: float) -> float:
    """The longest step that a user may ask for [s].

    A fifth of the contact time, and no longer than is stable where a grain's contacts are all at the overlap bound:
    twelve that slide freely or, with friction, six that stick.
    """
    shares = [stable_step(material.restitution)]
    if material.friction > 0:
        shares.append(stable_step(material.restitution, neighbours=STICKING_NEIGHBOURS, sticking=True))
    return min(1 / FEWEST_STEPS_PER_CONTACT, _PAIR * min(shares)) * contact_time(
        material, diameter=diameter, max_overlap=max_overlap
    )


def time_step_for(material: Material, *, diameter: float, max_overlap: float, wanted: float | None = None) -> float:
    """The time step [s]: an eighth of the shortest contact time, or the one wanted if it is short enough.

    For grains so strongly damped that an eighth may be unstable (e below 0.48 with friction, below 0.3 without), the
    longest that is stable. Raises ValueError: the step wanted is not positive, or longer than ``longest_step``.
    """
    shortest = contact_time(material, diameter=diameter, max_overlap=max_overlap)
    longest = longest_step(material, diameter=diameter, max_overlap=max_overlap)
    own = min(shortest / STEPS_PER_CONTACT, longest)
    if wanted is None:
        return own
    if not 0 < wanted <= longest:
        raise ValueError(
            f"time_step = {wanted:g} s is outside 0 to {longest:.3g} s, the longest that is resolved and stable "
            f"({longest / shortest:.3g} of the shortest contact time, {shortest:.3g} s, for grains of {diameter:g} m "
            f"with E = {material.young:.3g} Pa and restitution {material.restitution:g} at an overlap of "
            f"{100 * max_overlap:g} %); leave it out to have {own:.3g} s"
        )
    return wanted


def choose_young(
    material: Material, *, pressure: float, speed: float, max_overlap: float, diameter: float | None = None
) -> float:
    """The softest Young's modulus that keeps overlaps within the bound [Pa]; never above the material's own.

    It meets the larger of two needs. One is a bed under pressure, whose mean contact force is about p d^2 and its
    largest ``CHAIN`` times that (F = 2/3 E* d^2 (delta/d)^1.5). The other is a collision of two grains ((delta/d)^2.5 =
    15 pi / 96 rho v^2 / E*).

    Args:
        pressure: the largest on the grains [Pa]. speed: of the fastest collision [m/s].
        max_overlap: the bound, over diameter [1].
        diameter: of the grains [m]; only cohesion needs it, whose pull on a plane, 2 pi gamma d, presses as well.

    Raises ValueError: cohesion, and no diameter.
    """
    pressed = 1.5 * CHAIN * pressure / max_overlap**1.5
    if material.cohesion != "none":
        if diameter is None:
            raise ValueError(f"diameter is needed for grains with cohesion {material.cohesion!r}")
        pressed += 1.5 * (2 * math.pi * material.surface_energy / diameter) / max_overlap**1.5
    struck = 15 * math.pi / 96 * material.density * speed**2 / max_overlap**2.5
    effective = max(pressed, struck)
    return min(material.young, 2 * (1 - material.poisson**2) * effective)
