"""The contact law between two grains, or a grain and a body.

Hertz's normal force, Mindlin's tangential spring with history and Coulomb sliding, and elastic-plastic
spring-dashpots for rolling and twisting. All functions are Taichi functions that see one contact; they know nothing of
lists or grids.

Normal (Hertz; Thornton, Cummins & Cleary 2013, Powder Technology 233:30 for the damping):
    F_n = max(0, 4/3 E* a d + c_n sqrt(m* S_n) d'),  a = sqrt(R* d),  S_n = 2 E* a,
    d the overlap, with c_n from the restitution asked for (``damping_factor``).
Tangential (Mindlin 1949, no-slip stiffness; total force bounded by Coulomb's law):
    F_t = -(S_t u + c_n sqrt(S_t / S_n) sqrt(m* S_n) u'),  S_t = 8 G* a,  |F_t| <= mu F_n.
Rolling (elastic-plastic spring-dashpot, Ai et al. 2011, Powder Technology 206:269, with the stiffness S_t R*^2 of the
tangential spring at the rolling radius):
    M = -(k_r q + c_r q'),  q' the relative rolling rate,  |M| <= mu_r R* F_n.
    The bound holds for spring and dashpot together, and the spring is set back to what it allows; a grain at rest is
    held by the spring alone, so it does not creep.
Twisting, where there is rolling resistance: the same form about the normal, with Marshall's 2009 stiffness S_t a^2 / 2
(J. Comput. Phys. 228:1541) and the torque of a fully sliding Hertzian contact as bound, 3 pi / 16 mu a F_n (Johnson
1985, section 7.4), so that a grain does not spin on one contact for ever.
Cohesion (``dem.cohesion``): DMT takes 2 pi w R* off the normal force, JKR has a force and a contact radius of its own.
Damping never makes a pair pull more than its pull-off force; without cohesion that is the cut at zero. In the bounds of
friction, rolling and twisting the load that presses the surfaces together stands for F_n: F_n + 2 pi w R* with DMT, F_n
+ 2 (3/2 pi w R*) with JKR (Thornton 1991, J. Phys. D 24:1942; Marshall 2009).
"""

import math

import taichi as ti

from .cohesion import DMT, JKR, jkr_force, jkr_reach, work_of_adhesion

__all__ = [
    "adhesive_range",
    "contact_force",
    "damping_factor",
    "effective_moduli",
    "pair_parameters",
    "turning_torque",
    "PAIR_WIDTH",
]

# Entries of a row of pair parameters.
PAIR_WIDTH = 8
_TWO_E, _EIGHT_G, _DAMPING, _FRICTION, _ROLLING, _TANGENTIAL_DAMPING, _TURNING_DAMPING, _PI_W = range(8)

# Share of critical damping of the rolling and twisting springs (Ai et al. 2011 use 0.3).
TURNING_DAMPING_RATIO = 0.3

# Thornton et al. 2013, eq. 15 and table: the damping that gives restitution e when the contact may not pull.
_THORNTON = (-6.918798, -16.41105, 146.8049, -796.4559, 2928.711, -7206.864, 11494.29, -11342.18, 6276.757, -1489.915)
# Its error in e is below 3e-4 up to here and grows beyond: 0.972 comes out where 0.98 is asked for.
_THORNTON_HOLDS_TO = 0.9
_LEAST_RESTITUTION = 0.01


def damping_factor(restitution: float, *, tensile: bool = False) -> float:
    """The factor c_n of the normal damping force c_n sqrt(m* S_n) v that gives a restitution at any speed.

    Args:
        restitution: rebound over approach speed [1], 0.01 to 1.
        tensile: True where the contact may pull at its end (Tsuji et al. 1992: 2 sqrt(5/6) |beta|); False where the
            force is cut at zero (Thornton et al. 2013's fit up to 0.9).

    Raises:
        ValueError: a restitution outside 0.01 to 1.
    """
    if not _LEAST_RESTITUTION <= restitution <= 1:
        raise ValueError(f"restitution = {restitution} must lie between {_LEAST_RESTITUTION} and 1")
    if restitution == 1:
        return 0.0
    if tensile:
        log = math.log(restitution)
        return 2 * math.sqrt(5 / 6) * -log / math.hypot(log, math.pi)
    if restitution > _THORNTON_HOLDS_TO:
        # Cutting the force at zero changes little then; to second order, from the equation of motion integrated.
        loss = 1 - restitution
        return damping_factor(restitution, tensile=True) * (1 + 0.2025 * loss * (1 + loss))
    polynomial = 0.0
    for coefficient in reversed(_THORNTON):
        polynomial = restitution * (coefficient + polynomial)
    return 2 * math.sqrt(1 / (1 - (1 + restitution) ** 2 * math.exp(polynomial)) - 1)


def effective_moduli(young_1: float, poisson_1: float, young_2: float, poisson_2: float) -> tuple[float, float]:
    """E* and G* of two materials [Pa] (Johnson 1985, sections 4.2 and 7.3); an infinite modulus is a rigid body."""
    compliance = (1 - poisson_1**2) / young_1 + (1 - poisson_2**2) / young_2
    shear = 2 * (2 - poisson_1) * (1 + poisson_1) / young_1 + 2 * (2 - poisson_2) * (1 + poisson_2) / young_2
    return 1 / compliance, 1 / shear


def pair_parameters(
    *,
    effective_young: float,
    effective_shear: float,
    restitution: float,
    friction: float,
    rolling_friction: float = 0.0,
    surface_energy: float = 0.0,
    tensile: bool = False,
) -> list[float]:
    """One row of the table that the kernels read: everything of a pair that does not depend on the grains' sizes.

    Args:
        effective_young, effective_shear: E*, G* [Pa].
        restitution, friction, rolling_friction: [1].
        surface_energy: of the pair [J/m2].

    Raises:
        ValueError: from ``damping_factor``; a negative friction or surface energy.
    """
    if not (friction >= 0 and rolling_friction >= 0):
        raise ValueError(f"friction = {friction} and rolling friction = {rolling_friction} must not be negative")
    if not 0 <= surface_energy < math.inf:
        raise ValueError(f"surface_energy = {surface_energy} must be 0 or more [J/m2]")
    factor = damping_factor(restitution, tensile=tensile)
    ratio = math.sqrt(8 * effective_shear / (2 * effective_young))
    turning = 2 * TURNING_DAMPING_RATIO * math.sqrt(0.4) * ratio
    return [
        2 * effective_young,
        8 * effective_shear,
        factor,
        friction,
        rolling_friction,
        factor * ratio,
        turning,
        math.pi * work_of_adhesion(surface_energy),
    ]


@ti.func
def adhesive_range(p: ti.template(), radius):
    """How far apart the surfaces of a JKR pair are when it parts [m]; ``radius`` the effective one [m]."""
    return jkr_reach(p[_TWO_E], p[_PI_W], radius)


@ti.func
def contact_force(
    p: ti.template(),
    n,
    v,
    overlap,
    radius,
    mass,
    dt,
    u: ti.template(),
    tensile: ti.template(),
    cohesion: ti.template(),
):
    """Force on the first of a pair, without rolling.

    ``p`` the pair's parameters, ``n`` the unit normal towards the first, ``v`` the relative velocity of the first at
    the contact point [m/s], ``overlap`` [m], ``radius``, ``mass`` the effective ones, ``u`` the tangential
    displacement [m], updated in place. Returns (normal force [N], tangential force vector [N], tangential stiffness
    [N/m], contact radius [m], sqrt(m* S_n), load that presses the surfaces together [N]).
    """
    a = ti.sqrt(radius * overlap)
    spring = a * 0.0
    if ti.static(cohesion == JKR):
        a, spring = jkr_force(p[_TWO_E], p[_PI_W], overlap, radius)
    s_n = p[_TWO_E] * a
    root = ti.sqrt(mass * s_n)
    v_n = v.dot(n)
    if ti.static(cohesion != JKR):
        spring = (2.0 / 3.0) * s_n * overlap
    f_n = spring - p[_DAMPING] * root * v_n
    load = f_n
    if ti.static(cohesion == JKR):
        pull = 1.5 * p[_PI_W] * radius
        if ti.static(not tensile):
            f_n = ti.max(f_n, -pull)
        load = f_n + 2.0 * pull
    else:
        if ti.static(not tensile):
            f_n = ti.max(f_n, 0.0)
        load = f_n
        if ti.static(cohesion == DMT):
            f_n -= 2.0 * p[_PI_W] * radius
    k_t = p[_EIGHT_G] * a
    c_t = p[_TANGENTIAL_DAMPING] * root
    v_t = v - v_n * n
    u += v_t * dt
    u -= u.dot(n) * n
    f_t = -(k_t * u + c_t * v_t)
    bound = p[_FRICTION] * ti.abs(load)
    square = f_t.norm_sqr()
    if square > bound * bound:
        f_t *= bound / ti.sqrt(square)
        u = -(f_t + c_t * v_t) / k_t
    return f_n, f_t, k_t, a, root, load


@ti.func
def turning_torque(p: ti.template(), n, spin, load, k_t, a, radius, root, dt, q: ti.template()):
    """Rolling and twisting torque on the first of a pair [N m].

    ``spin`` the relative angular velocity, ``load`` what presses the surfaces together [N], ``a`` the contact radius
    [m], ``root`` sqrt(m* S_n), ``q`` the angle turned [rad], updated in place: its normal part is twisting, the rest
    rolling. The dampings are shares of the critical one for the inertia 2/5 m* R*^2; as S_t is a fixed multiple of S_n,
    they come from ``root`` without another root.
    """
    q += spin * dt
    spin_n = spin.dot(n)
    roll_rate = spin - spin_n * n
    twist = q.dot(n)
    roll = q - twist * n
    force = ti.abs(load)

    k_r = k_t * radius * radius
    c_r = p[_TURNING_DAMPING] * root * radius * radius
    m = -(k_r * roll + c_r * roll_rate)
    bound = p[_ROLLING] * radius * force
    square = m.norm_sqr()
    if square > bound * bound:
        m *= bound / ti.sqrt(square)
        roll = -(m + c_r * roll_rate) / k_r

    k_w = 0.5 * k_t * a * a
    c_w = 0.7071067811865476 * p[_TURNING_DAMPING] * root * radius * a
    m_n = -(k_w * twist + c_w * spin_n)
    bound = 0.1875 * ti.math.pi * p[_FRICTION] * a * force
    if ti.abs(m_n) > bound:
        m_n = ti.select(m_n > 0.0, bound, -bound)
        twist = -(m_n + c_w * spin_n) / k_w
    q = roll + twist * n
    return m + m_n * n
