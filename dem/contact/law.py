"""The contact law between two grains, or a grain and a body.

Hertz's normal force, Mindlin's tangential spring with history and Coulomb sliding, and elastic-plastic
spring-dashpots for rolling and twisting. All functions are Taichi functions that see one contact; they know nothing of
lists or grids.

Normal (Hertz; Thornton, Cummins & Cleary 2013, Powder Technology 233:30 for the damping):
    F_n = max(0, 4/3 E* a d + c_n sqrt(m* S_n) d'),  a = sqrt(R* d),  S_n = 2 E* a,
    d the overlap, with c_n from the restitution asked for (``damping_factor``).
Tangential (Mindlin 1949, no-slip stiffness; Coulomb's law bounds the spring, and the dashpot acts while it sticks):
    F_t = -S_t u,  |S_t u| set back to mu F_n where it is more;
    else F_t = -(S_t u + c_n sqrt(S_t / S_n) sqrt(m* S_n) u'), |F_t| <= mu F_n;  S_t = 8 G* a.
    Two springs (``dem.grains.materials.TANGENTIAL``):
    "displacement": u is what has slid, whatever a is by now (LIGGGHTS' ``history``, LAMMPS' ``mindlin``);
    "rescaled": while a grows, S_t u stays and u falls; while a falls, u stays and S_t u falls (Thornton, Cummins &
    Cleary 2013; LAMMPS' ``mindlin_rescale/force``). It makes no energy, see below.
Rolling (elastic-plastic spring-dashpot, Ai et al. 2011, Powder Technology 206:269, with the stiffness S_t R*^2 of the
tangential spring at the rolling radius):
    M = -(k_r q + c_r q'),  q' the relative rolling rate; the spring bounded by mu_r R* F_n in the same way.
    A grain at rest is held by the spring alone, so it does not creep.
Twisting, where there is rolling resistance: the same form about the normal, with Marshall's 2009 stiffness S_t a^2 / 2
(J. Comput. Phys. 228:1541) and the torque of a fully sliding Hertzian contact as bound, 3 pi / 16 mu a F_n (Johnson
1985, section 7.4). This bound stops a grain from spinning on one contact for ever.
Cohesion (``dem.contact.cohesion``): DMT takes 2 pi w R* off the normal force, JKR has a force and a contact radius of
its own. Damping never makes a pair pull more than its pull-off force; without cohesion that is the cut at zero. In the
bounds of friction, rolling and twisting the load that presses the surfaces together stands for F_n: F_n + 2 pi w R*
with DMT, F_n + 2 (3/2 pi w R*) with JKR (Thornton 1991, J. Phys. D 24:1942; Marshall 2009).

A spring that makes no energy. The normal force does not know of the tangential spring; so whatever that comes to hold,
U = S_t u^2 / 2, has to be done as work along the slip. As a changes without slip there is no work. With u kept
("displacement") U follows a up and down: slip, closing, slip back, parting makes (S_2 - S_1) u^2 / 2. With S_t u kept
as a grows ("rescaled") U = (S_t u)^2 / 2 S_t falls then, too: every change of a takes energy, slip at one a takes none,
and no order of the two makes any. Rolling and twisting likewise, whose stiffnesses go with a and a^3. The contact
radius of the step before is that of the overlap less what has closed since, known to third order in the step: it needs
no memory.
A rescaled spring also turns with its pair, at its full length: by the least turn that brings the normal of the step
before to n, then about n by the mean of both spins. With m the middle of both normals, the first is u - (u n) m for a
vector across the normal. For any vector it is two reflections, across m and across n. The displacement spring is
projected onto the plane of n, and does not turn about n.

In time. Velocities live half a step behind positions.
- The normal dashpot wants d' at the time of the force. A contact remembers ``past`` = (m* v + dt F) / 2 of the step
  before. Let a = (v - v_before) / dt be the last relative acceleration, whoever caused it, and F the pair's own force.
  Then v + dt a / 2 + dt (F - F_before) / 2 m* = 3/2 v + (dt F / 2 - past) / m*. F then stands on both sides, linearly.
  Of a pair alone this is the velocity after half a kick by F itself; at rest it is zero.
- The force of the step in which a pair came to touch stands for the time from the touch to half a step later. Hertz's
  dashpot starts as d^(1/4), so its mean over that time is 4/5 (f + 1/2)^(5/4) / f^(1/4) of its value at the step's end.
  Here f is the share of the step for which the pair has touched.
- The slip of a step is taken across the normal m at the step's middle, the time of the velocity, with the arms of that
  time. It is then laid into the plane of n. With m = n - h v_t, h = dt / 2 |x_i - x_j| and v_t what of v = v_i - v_j is
  across n, it is (1 + h v n) v_t - W x n - h (W n) v_t x n, W the spins times their arms, but for terms of second order
  in h. The last is left out where the spring does not turn about n either ("displacement").
- A rescaled spring is turned and rescaled with half of the step's slip in it, the other half comes after: right to
  second order, and of no more energy than the work, as F_t changes by the mean S_t of the step while a grows.
The dashpots of friction, rolling and twisting see the half-step velocity.
"""

import math
from typing import Any

from dem.grains.materials import Facing, Material
from hedgebed_taichi import ti

from .cohesion import DMT, JKR, jkr_force, jkr_reach

__all__ = [
    "contact_force",
    "damping_factor",
    "effective_moduli",
    "onset_of",
    "pair_parameters",
    "pair_row",
    "turning_torque",
]

Template: Any = (
    ti.template()
)  # An argument that is taken as it is: known as the kernel is compiled, or updated in place

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
        restitution: rebound over approach speed [1], 0.01 to 1; ValueError outside.
        tensile: True where the contact may pull at its end (Tsuji et al. 1992: 2 sqrt(5/6) |beta|); False where the
            force is cut at zero (Thornton et al. 2013's fit up to 0.9).
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

    E*, G* [Pa]; restitution, friction, rolling_friction [1]; surface_energy of the pair [J/m2]. Raises ValueError: from
    ``damping_factor``; a negative friction or surface energy.
    """
    if not (friction >= 0 and rolling_friction >= 0):
        raise ValueError(f"friction = {friction} and rolling friction = {rolling_friction} must not be negative")
    if not 0 <= surface_energy < math.inf:
        raise ValueError(f"surface_energy = {surface_energy} must be 0 or more [J/m2]")
    factor = damping_factor(restitution, tensile=tensile)
    ratio = math.sqrt(8 * effective_shear / (2 * effective_young))
    turning = 2 * TURNING_DAMPING_RATIO * math.sqrt(0.4) * ratio
    stiffness = [2 * effective_young, 8 * effective_shear]
    return [*stiffness, factor, friction, rolling_friction, factor * ratio, turning, math.pi * (2 * surface_energy)]


def pair_row(material: Material, facing: Facing | None = None, *, tensile: bool = False) -> list[float]:
    """``pair_parameters`` of two grains of a material, or of one of them on what a ``Facing`` describes."""
    facing = facing or Facing(young=material.young, poisson=material.poisson)
    young = math.inf if facing.young is None else facing.young
    poisson = material.poisson if facing.young is None else facing.poisson
    effective_young, effective_shear = effective_moduli(material.young, material.poisson, young, poisson)
    names = ("restitution", "friction", "rolling_friction", "surface_energy")
    own = {name: float(getattr(material, name)) for name in names}
    own |= {name: float(value) for name in names if (value := getattr(facing, name)) is not None}
    return pair_parameters(effective_young=effective_young, effective_shear=effective_shear, tensile=tensile, **own)


@ti.func
def adhesive_range(p: Template, radius):
    """How far apart the surfaces of a JKR pair are when it parts [m]; ``radius`` the effective one [m]."""
    return jkr_reach(p[_TWO_E], p[_PI_W], radius)


@ti.func
def contact_force(
    p: Template, n, v_n, v_t, overlap, radius, mass, onset, dt, u: Template, tensile: Template, cohesion: Template,
    rescaled: Template, closed, middle, angle,
):  # fmt: skip
    """Force on the first of a pair, without rolling.

    ``p`` has the pair's parameters, ``n`` is the unit normal towards the first. ``v_n`` is the rate at which the first
    moves away, ``v_t`` the slip across n, both half a step before [m/s]. ``overlap`` [m], ``radius`` and ``mass`` are
    the effective ones, ``onset`` is from ``onset_of``. ``dt`` is the time since the last force; it is 0 where forces
    are computed anew, which leaves the history alone. ``u`` is the history, updated in place: tangential displacement
    [m] and ``past`` [kg m/s], 0 for a new contact.
    A ``rescaled`` spring needs three more. ``closed`` is what the overlap has gained over the step [m]. ``middle`` is
    the middle of both normals, whose part along n is 1. ``angle`` is how far the pair has turned about it [rad].
    Returns first (normal force [N]; the dashpot's part of it [N]; tangential force vector [N]; tangential stiffness
    [N/m]; contact radius [m]). Then follow sqrt(m* S_n), the load that presses the surfaces together [N] and the
    contact radius of the step before over that of now, at most 1.
    """
    # Single precision on a GPU has a root that is no better than its last digit, and an overlap that may be below 0.
    a = ti.sqrt(radius * ti.max(overlap, 0.0))
    spring = a * 0.0
    if ti.static(cohesion == JKR):
        a, spring = jkr_force(p[_TWO_E], p[_PI_W], overlap, radius)
    s_n = p[_TWO_E] * a
    root = ti.sqrt(mass * s_n)
    pull = a * 0.0
    if ti.static(cohesion == JKR):
        pull = 1.5 * p[_PI_W] * radius
    else:
        spring = (2.0 / 3.0) * s_n * overlap
        if ti.static(cohesion == DMT):
            pull = 2.0 * p[_PI_W] * radius
            spring -= pull
    c_n = p[_DAMPING] * root
    c_n *= onset
    momentum = mass * v_n
    past = ti.select(u.w == 0.0 or dt == 0.0, 0.5 * momentum, u.w)
    f_n = (mass * spring - c_n * (1.5 * momentum - past)) / (mass + 0.5 * dt * c_n)
    if ti.static(not tensile):
        f_n = ti.max(f_n, -pull)
    load = f_n
    if ti.static(cohesion == DMT):
        load += pull
    if ti.static(cohesion == JKR):
        load += 2.0 * pull

    k_t = p[_EIGHT_G] * a
    c_t = p[_TANGENTIAL_DAMPING] * root
    grown = a * 0.0 + 1.0
    stretch = u.xyz
    if ti.static(rescaled):
        before = overlap - ti.max(closed, 0.0)
        if ti.static(cohesion == JKR):
            if closed > 0.0:
                a_before, _ = jkr_force(p[_TWO_E], p[_PI_W], before, radius)
                grown = a_before / a
        else:
            # sqrt(before / overlap), within x^3 / 32 of it, x the share of the overlap that is new.
            before = ti.max(before, 0.0)
            grown = (overlap + 3.0 * before) / (3.0 * overlap + before)
        half = (0.5 * dt) * v_t
        stretch += half
        across = stretch - stretch.dot(n) * middle
        stretch = grown * ((1.0 - 0.5 * angle * angle) * across + angle * n.cross(stretch)) + half
    else:
        stretch += dt * v_t
        stretch -= stretch.dot(n) * n
    f_t, share = bounded(k_t, c_t, stretch, v_t, p[_FRICTION] * ti.abs(load))
    if dt > 0.0:
        u.xyz = share * stretch
        u.w = 0.5 * (momentum + dt * f_n)
    return f_n, f_n - spring, f_t, k_t, a, root, load, grown


@ti.func
def springs_hold(p: Template, n, overlap, radius, u, q, cohesion: Template):
    """What a contact's springs hold [J]: the tangential one; the rolling and the twisting one. As ``contact_force``."""
    a = ti.sqrt(radius * ti.max(overlap, 0.0))
    if ti.static(cohesion == JKR):
        a, _ = jkr_force(p[_TWO_E], p[_PI_W], overlap, radius)
    half = 0.5 * p[_EIGHT_G] * a
    twist = q.dot(n)
    turned = radius * radius * (q.norm_sqr() - twist * twist) + 0.5 * a * a * twist * twist
    return half * u.xyz.norm_sqr(), half * turned


@ti.func
def onset_of(v_n, overlap, dt, past, cohesion: Template):
    """What the normal dashpot is multiplied by: 1, or more in the step in which a pair came to touch.

    That is the mean of d^(1/4) from the touch to half a step on, over its value now. Arguments as of ``contact_force``.
    """
    result = overlap * 0.0 + 1.0
    if ti.static(cohesion != JKR):
        # Apart a step ago, but for round-off; not so where forces begin with overlaps.
        if past == 0.0 and overlap < -1.001 * v_n * dt:
            f = ti.max(overlap / (-v_n * dt), 1e-6)
            result = 0.8 * (f + 0.5) * ti.sqrt(ti.sqrt((f + 0.5) / f))
    return result


@ti.func
def bounded(stiffness, damping, stretch, rate, bound):
    """Force of a spring that slides at a bound, with a dashpot while it sticks; and the share of the stretch left."""
    force = -stiffness * stretch
    limit = bound * bound
    slides = force.norm_sqr() > limit
    force -= ti.select(slides, damping * 0.0, damping) * rate
    square = force.norm_sqr()
    one = bound * 0.0 + 1.0
    scale = ti.select(square > limit, bound / ti.sqrt(square), one)
    return scale * force, ti.select(slides, scale, one)


@ti.func
def turning_torque(
    p: Template, n, spin, load, k_t, a, radius, root, dt, q: Template, rescaled: Template, grown, middle, angle
):
    """Rolling and twisting torque on the first of a pair [N m].

    ``spin`` the relative angular velocity, ``load`` what presses the surfaces together [N], ``a`` the contact radius
    [m], ``root`` sqrt(m* S_n), ``q`` the angle turned [rad], updated in place: its normal part is twisting, the rest
    rolling. The dampings are shares of the critical one for the inertia 2/5 m* R*^2; as S_t is a fixed multiple of S_n,
    they come from ``root`` without another root. The rest is as ``contact_force`` has it.
    """
    spin_n = spin.dot(n)
    twist = spin_n * 0.0
    roll = spin
    if ti.static(rescaled):
        turned = q + (0.5 * dt) * spin
        across = (4.0 - 2.0 * middle.norm_sqr()) * turned.dot(middle)
        twist = across - turned.dot(n)
        turned -= across * middle
        roll = grown * ((1.0 - 0.5 * angle * angle) * (turned + twist * n) + angle * n.cross(turned))
        roll += (0.5 * dt) * (spin - spin_n * n)
        twist = grown * grown * grown * twist + (0.5 * dt) * spin_n
    else:
        q += spin * dt
        twist = q.dot(n)
        roll = q - twist * n
    force = ti.abs(load)

    k_r = k_t * radius * radius
    c_r = p[_TURNING_DAMPING] * root * radius * radius
    m, share = bounded(k_r, c_r, roll, spin - spin_n * n, p[_ROLLING] * radius * force)

    k_w = 0.5 * k_t * a * a
    c_w = 0.7071067811865476 * p[_TURNING_DAMPING] * root * radius * a
    bound = 0.1875 * ti.math.pi * p[_FRICTION] * a * force
    m_n = -k_w * twist
    slides = ti.abs(m_n) > bound
    held = ti.select(m_n > 0.0, bound, -bound)
    m_n = ti.select(slides, held, ti.min(bound, ti.max(-bound, m_n - c_w * spin_n)))
    twist = ti.select(slides, -held / k_w, twist)
    if dt > 0.0:
        q = share * roll + twist * n
    return m + m_n * n
