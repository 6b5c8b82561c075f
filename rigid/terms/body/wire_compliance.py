"""The rig's wires as springs: the counterweight no longer moves exactly as the platform does, upside down.

The counterweight hangs at -b + const, b its descent; eta is the height of the shaft. The wires are stretched by
s = b - eta beyond their stretch at rest, m_b g / k. There their tension is m_b g, whatever gravity_sim says: what
(m - m_b) g differs from the weight is borne by the platform. In place of the rigid rig's m_b eta'^2 / 2

    T = m_b b'^2 / 2,  V = k s^2 / 2,  D = c s'^2 / 2,

which gives m_b b'' = -(k s + c s'), and k s + c s' upwards on the shaft. A wire does not push: where the whole tension
m_b g + k s + c s' would fall below zero the wires are slack. Counterweight and platform then fall separately, and
V = -m_b g s + const continues from there. They are taut again at full length, where their tension is positive.
"""

import math

from rigid.terms.term import Parameter, Term


def own_inertia(s, stiffness):
    """T = m_b (b'^2 - eta'^2) / 2: the platform no longer carries the counterweight's inertia with it."""
    m = 0.0
    if stiffness < 1e300:
        m = s.counterweight
    return -m * s.up_x * s.up_x, -m * s.up_x * s.up_y, -m * s.up_y * s.up_y, 0.0, 0.0, 0.0


def wire_potential(s, stiffness):
    """V = k s^2 / 2 while the wires are at full length, in a straight line on from there where they are slack."""
    energy = 0.0
    if stiffness < 1e300:
        stretch = s.inner - s.up_x * s.x - s.up_y * s.y
        rest = s.counterweight * s.gravity
        energy = 0.5 * stiffness * stretch * stretch
        if stiffness * stretch < -rest:
            energy = -rest * (stretch + 0.5 * rest / stiffness)
    return energy


def wire_force(s, stiffness, damping):
    """What the wires pull up with beyond their tension at rest; slack, all of that is missing."""
    pull = 0.0
    if stiffness < 1e300:
        pull = -s.counterweight * s.gravity
        if s.inner_mode > 0.5:
            stretch = s.inner - s.up_x * s.x - s.up_y * s.y
            pull = stiffness * stretch + damping * (s.inner_speed - s.up_x * s.vx - s.up_y * s.vy)
    return pull * s.up_x, pull * s.up_y, 0.0


def wire_loss(s, stiffness, damping):
    """c s'^2; of wires that shorten slack, by their damping, what their spring still releases."""
    power = 0.0
    if stiffness < 1e300:
        rate = s.inner_speed - s.up_x * s.vx - s.up_y * s.vy
        power = damping * rate * rate
        if s.inner_mode < 0.5:
            full = s.counterweight * s.gravity / stiffness + s.inner - s.up_x * s.x - s.up_y * s.y
            power = -stiffness * max(full, 0.0) * rate
    return power


def counterweight_inertia(s, stiffness):
    """m_b."""
    m = 0.0
    if stiffness < 1e300:
        m = s.counterweight
    return m


def counterweight_start(s):
    """b = eta: wires at their rest tension."""
    return s.up_x * s.x + s.up_y * s.y


def counterweight_force(s, stiffness, damping):
    """-(k s + c s'); slack, its weight."""
    pull = 0.0
    if stiffness < 1e300:
        pull = -s.counterweight * s.gravity
        if s.inner_mode > 0.5:
            stretch = s.inner - s.up_x * s.x - s.up_y * s.y
            pull = stiffness * stretch + damping * (s.inner_speed - s.up_x * s.vx - s.up_y * s.vy)
    return -pull


def taut_or_slack(s, stiffness, damping):
    """Taut: the whole tension over k; slack: how far the wires are from being taut."""
    holds = 1.0
    if stiffness < 1e300:
        full = s.counterweight * s.gravity / stiffness + s.inner - s.up_x * s.x - s.up_y * s.y
        tension = full + damping / stiffness * (s.inner_speed - s.up_x * s.vx - s.up_y * s.vy)
        holds = tension
        if s.inner_mode < 0.5:
            holds = -min(full, tension)
    return holds


TERM = Term(
    rank=90, id="wire-compliance", summary="the rig's wires are springs",
    acts="T, V and D, with a coordinate of its own: the counterweight's descent", needs_rig=True,
    parameters=(
        Parameter("stiffness", "N/m", math.inf, "k, EA / length of all wires from the shaft to the counterweight",
                  lowest=0.0, above_lowest=True, visible=(5e3, 4e4)),
        Parameter("damping", "N s/m", 0.0, "c, while they are taut", lowest=0.0, visible=(5.0, 60.0)),
    ),
    source="Hooke's law; EA = 57 GPa d^2 for a 7x7 and 43 GPa d^2 for a 7x19 stainless wire rope of diameter d "
           "(Loos and Company's stretch factors): 13 kN/m for one 7x7 of 1 mm that is 4.4 m long",
    limits="wires without mass (waves along 4.4 m of steel: 400 Hz), stretched between pulleys and "
           "counterweight, so that pulleys' inertia and friction stay with the shaft; the pendulum keeps its rest "
           "tension; no pull in slack wires, none lost when they snap taut but by c",
    hooks={
        "mass": own_inertia, "potential": wire_potential, "force": wire_force, "loss": wire_loss,
        "inner_mass": counterweight_inertia, "inner_start": counterweight_start,
        "inner_force": counterweight_force, "inner_holds": taut_or_slack,
    },
)  # fmt: skip
