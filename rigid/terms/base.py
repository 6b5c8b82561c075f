"""The paper's model as a list of terms (Reid, Roveda, Nesnas and Pavone, i-SAIRAS 2014, eqs 1 to 19).

Contact and friction are the ground's law and Coulomb's; `rigid.model.model` assembles them.
"""

from .term import Term

__all__ = ["BASE"]


def platform_mass(s):
    """T = m (vx^2 + vy^2) / 2 + J omega^2 / 2."""
    return s.mass, 0.0, s.mass, 0.0, 0.0, s.inertia


def counterweight_mass(s):
    """T = m_b (vertical speed)^2 / 2: the counterweight moves as the platform does, upside down."""
    m = s.counterweight
    return m * s.up_x * s.up_x, m * s.up_x * s.up_y, m * s.up_y * s.up_y, 0.0, 0.0, 0.0


def gravity_potential(s):
    """V = W height, W = (m + m_b) g_sim, at the shaft."""
    return s.weight * (s.up_x * s.x + s.up_y * s.y)


def gravity_force(s):
    """-dV/dq."""
    return -s.weight * s.up_x, -s.weight * s.up_y, 0.0


def flywheel_force(s):
    """Virtual work tau d theta: the reaction of the flywheel."""
    return 0.0, 0.0, s.torque


BASE: tuple[Term, ...] = (
    Term(
        id="platform", summary="inertia of the platform", acts="T", source="paper, eq. 8",
        limits="rigid, the wheels' mass included and their spin not", hooks={"mass": platform_mass},
    ),
    Term(
        id="counterweight", summary="inertia of the rig's counterweight", acts="T", source="paper, eqs 17 to 19",
        limits="wires that neither stretch nor swing", hooks={"mass": counterweight_mass},
    ),
    Term(
        id="gravity", summary="weight on the surface", acts="V", source="paper, eqs 9 and 19, W = (m + m_b) g_sim",
        limits="uniform", hooks={"potential": gravity_potential, "force": gravity_force},
    ),
    Term(
        id="flywheel", summary="reaction of the flywheel's torque", acts="virtual work", source="paper, eq. 10",
        limits="constant torque while any spike touches", hooks={"force": flywheel_force},
    ),
)  # fmt: skip
"""The terms that are always on, in the order in which they are summed."""
