"""Effects on the body: the rig's wires and pulleys, the mass off the shaft, the slope, cable, bearing and motor."""

import math
from math import cos, exp, sin, sqrt

from .term import Parameter, Term

__all__ = ["BODY_EFFECTS"]


def pendulum_potential(s, length, offset, arc):
    """V = m_b g [(1 - c) d^2 / 2 L + c (sqrt(a^2 + d^2) - a)], d the horizontal distance from under the pulleys.

    a = L - rise is the height of the pulleys above the shaft; sqrt(a^2 + d^2) - a is what the counterweight has risen.
    """
    d = s.up_y * s.x - s.up_x * (s.y - s.stance) - offset
    a = length - s.up_x * s.x - s.up_y * (s.y - s.stance)
    raised = d * d / (sqrt(a * a + d * d) + a)
    return s.counterweight * s.gravity * ((1.0 - arc) * 0.5 * d * d / length + arc * raised)


def pendulum_force(s, length, offset, arc):
    """-dV/dq."""
    d = s.up_y * s.x - s.up_x * (s.y - s.stance) - offset
    a = length - s.up_x * s.x - s.up_y * (s.y - s.stance)
    reach = sqrt(a * a + d * d)
    tension = s.counterweight * s.gravity
    side = -tension * ((1.0 - arc) * d / length + arc * d / reach)
    down = -tension * arc * d * d / (reach * (reach + a))
    return side * s.up_y + down * s.up_x, down * s.up_y - side * s.up_x, 0.0


def com_offset_mass(s, x, y):
    """T = m v . e', e the offset in the world's axes, e' = omega (e_y, -e_x)."""
    ex = x * s.cosine + y * s.sine
    ey = y * s.cosine - x * s.sine
    return 0.0, 0.0, 0.0, s.mass * ey, -s.mass * ex, 0.0


def com_offset_potential(s, x, y):
    """V = m g (height of the centre of mass over the shaft), g the true gravity."""
    ex = x * s.cosine + y * s.sine
    ey = y * s.cosine - x * s.sine
    return s.mass * s.gravity * (ex * s.up_x + ey * s.up_y)


def com_offset_force(s, x, y):
    """Centripetal m omega^2 e, and -dV/d theta."""
    ex = x * s.cosine + y * s.sine
    ey = y * s.cosine - x * s.sine
    spin = s.mass * s.omega * s.omega
    return spin * ex, spin * ey, s.mass * s.gravity * (ex * s.up_y - ey * s.up_x)


def slope_up(angle):
    """The surface rises towards +x, so the vertical leans towards +x in the surface's axes."""
    return sin(angle), cos(angle)


def pulley_mass(s, mass):
    """T = m_p (vertical speed)^2 / 2, m_p = sum of I / r^2 over the pulleys."""
    return mass * s.up_x * s.up_x, mass * s.up_x * s.up_y, mass * s.up_y * s.up_y, 0.0, 0.0, 0.0


def rig_friction(s, force, excess, speed):
    """F (1 + a exp(-(v / v_0)^2)), v the vertical speed: dry friction of the pulleys, felt along the wires."""
    bound = force + 0.0 * s.vy
    if excess != 0.0:
        share = (s.up_x * s.vx + s.up_y * s.vy) / speed
        bound = force * (1.0 + excess * exp(-share * share))
    return bound


def bearing_drag(s, torque, excess, speed):
    """T (1 + a exp(-(omega / omega_0)^2)): dry friction of the shaft's bearings."""
    bound = torque + 0.0 * s.omega
    if excess != 0.0:
        share = s.omega / speed
        bound = torque * (1.0 + excess * exp(-share * share))
    return bound


def umbilical_potential(s, stiffness, spring_power, rest):
    """V = k |theta - theta_0|^(n + 1) / (n + 1)."""
    turned = s.theta - rest
    energy = 0.5 * stiffness * turned * turned
    if spring_power != 1.0:
        energy = stiffness * max(abs(turned), 1e-12) ** (spring_power + 1.0) / (spring_power + 1.0)
    return energy


def umbilical_force(s, stiffness, drag, spring_power, drag_power, rest):
    """-k (theta - theta_0) |theta - theta_0|^(n - 1) - c omega |omega|^(m - 1)."""
    turned = s.theta - rest
    spring = stiffness * turned
    if spring_power != 1.0:
        spring = spring * max(abs(turned), 1e-12) ** (spring_power - 1.0)
    resisted = drag * s.omega
    if drag_power != 1.0:
        resisted = resisted * max(abs(s.omega), 1e-12) ** (drag_power - 1.0)
    return 0.0, 0.0, -spring - resisted


def umbilical_loss(s, drag, drag_power):
    """c |omega|^(m + 1)."""
    power = drag * s.omega * s.omega
    if drag_power != 1.0:
        power = power * max(abs(s.omega), 1e-12) ** (drag_power - 1.0)
    return power


def torque_fade_factor(s, speed_loss, time_loss, speed_power, time_power):
    """1 - (a w)^p - (b t)^q, w the wheel's speed, never below zero; p = q = 1 are straight lines."""
    lost = speed_loss * abs(s.wheel_speed)
    if speed_power != 1.0:
        lost = max(lost, 1e-12) ** speed_power
    faded = time_loss * s.time
    if time_power != 1.0:
        faded = max(faded, 1e-12) ** time_power
    return max(0.0, 1.0 - lost - faded)


_STRIBECK = (
    "more near rest by Stribeck's curve (as Armstrong-Helouvry, Dupont and Canudas de Wit 1994, Automatica 30:1083, "
    "tell it)"
)

BODY_EFFECTS: tuple[Term, ...] = (
    Term(
        id="pendulum", summary="the rig's wires pull back", acts="V", needs_rig=True,
        parameters=(
            Parameter(name="length", unit="m", default=math.inf, lowest=0.0, above_lowest=True,
                      summary="from the pulleys down to the shaft"),
            Parameter(name="offset", unit="m", default=0.0, lowest=-1.0, highest=1.0,
                      summary="how far the pulleys stand towards +x of the start"),
            Parameter(name="arc", unit="1", default=0.0, lowest=0.0, highest=1.0,
                      summary="0: a long pendulum, which pulls back only; 1: the true arc, whose wires carry less too"),
        ),
        source="the rest tension times x / length of a long pendulum; the paper trusts its rig without it for 40 mm",
        limits="tension at its rest value m_b g (the motion changes it by a_y / g, below 1 %); with arc = 0 x far "
               "below the length: at 0.0085 g the arc adds a tenth of the weight at x / length = 0.06",
        hooks={"potential": pendulum_potential, "force": pendulum_force},
    ),
    Term(
        id="com-offset", summary="the centre of mass is off the shaft", acts="T and V",
        parameters=(
            Parameter(name="x", unit="m", default=0.0, lowest=-0.05, highest=0.05,
                      summary="along body x (forward at theta = 0)"),
            Parameter(name="y", unit="m", default=0.0, lowest=-0.05, highest=0.05,
                      summary="along body y (up at theta = 0)"),
        ),
        source="true gravity pulls at the centre of mass, the wires hold the shaft",
        limits="J stays the inertia about the shaft",
        hooks={"mass": com_offset_mass, "potential": com_offset_potential, "force": com_offset_force},
    ),
    Term(
        id="slope", summary="the surface is not level", acts="gravity, counterweight, wires: their direction",
        parameters=(
            Parameter(name="angle", unit="rad", default=0.0, lowest=-1.2, highest=1.2,
                      summary="the surface rises towards +x; x and y stay along and normal to it"),
        ),
        source="gravity and wires vertical, the camera's axes along the surface",
        limits="plane; the wires stay vertical", hooks={"up": slope_up},
    ),
    Term(
        id="pulley-inertia", summary="the pulleys turn with the wires", acts="T", needs_rig=True,
        parameters=(Parameter(name="mass", unit="kg", default=0.0, lowest=0.0,
                              summary="I / r^2 summed over the pulleys, added in y"),),
        source="Atwood's machine with a heavy pulley (any mechanics textbook)", limits="the wires do not slip",
        hooks={"mass": pulley_mass},
    ),
    Term(
        id="rig-friction", summary="pulleys resist vertical motion", acts="virtual work, dry friction", needs_rig=True,
        parameters=(
            Parameter(name="force", unit="N", default=0.0, lowest=0.0, summary="the same in both directions"),
            Parameter(name="excess", unit="1", default=0.0, lowest=0.0,
                      summary="a: what friction at rest has more, over that of fast motion"),
            Parameter(name="speed", unit="m/s", default=0.03, lowest=0.0, above_lowest=True,
                      summary="v_0 of exp(-(v / v_0)^2), by which the excess falls"),
        ),
        source=f"Coulomb friction of the pulleys' bearings; {_STRIBECK}",
        limits="the static bound is that of sliding as it starts; none that grows with speed",
        hooks={"vertical_friction": rig_friction},
    ),
    Term(
        id="bearing-drag", summary="constant torque against the rotation", acts="virtual work, dry friction",
        parameters=(
            Parameter(name="torque", unit="N m", default=0.0, lowest=0.0, summary="the same in both directions"),
            Parameter(name="excess", unit="1", default=0.0, lowest=0.0,
                      summary="a: what friction at rest has more, over that of fast rotation"),
            Parameter(name="speed", unit="rad/s", default=0.2, lowest=0.0, above_lowest=True,
                      summary="omega_0 of exp(-(omega / omega_0)^2), by which the excess falls"),
        ),
        source=f"Coulomb friction of the bearings on which the rig's wires hold the shaft; {_STRIBECK}",
        limits="the static bound is that of sliding as it starts; none that grows with speed",
        hooks={"rotation_friction": bearing_drag},
    ),
    Term(
        id="umbilical", summary="the cable pulls or drags on the rotation", acts="V and D",
        parameters=(
            Parameter(name="stiffness", unit="N m/rad", default=0.0, lowest=0.0, summary="bending of the cable"),
            Parameter(name="drag", unit="N m s/rad", default=0.0, lowest=0.0, summary="its inner friction"),
            Parameter(name="spring_power", unit="1", default=1.0, lowest=0.3, highest=4.0,
                      summary="of the angle that its torque goes with; where it is not 1, stiffness is at 1 rad"),
            Parameter(name="drag_power", unit="1", default=1.0, lowest=0.3, highest=3.0,
                      summary="of the rate that its drag goes with; where it is not 1, drag is at 1 rad/s"),
            Parameter(name="rest", unit="rad", default=0.0,
                      summary="theta_0: the angle at which it is free of torque; a cable that hangs wound up"),
        ),
        source="a cable as a torsion spring and a damper, straight or not",
        limits="the cable's pull on x and y is left out",
        hooks={"potential": umbilical_potential, "force": umbilical_force, "loss": umbilical_loss},
    ),
    Term(
        id="torque-fade", summary="the torque falls with speed or time", acts="virtual work: the flywheel's torque",
        parameters=(
            Parameter(name="speed_loss", unit="s/rad", default=0.0, lowest=0.0,
                      summary="share lost per rad/s of the wheel: 1 / no-load speed of a DC motor"),
            Parameter(name="time_loss", unit="1/s", default=0.0, lowest=0.0, summary="share lost a second: heating"),
            Parameter(name="speed_power", unit="1", default=1.0, lowest=0.2, highest=5.0,
                      summary="p of (speed_loss w)^p: 1 a straight line, above it falls late"),
            Parameter(name="time_power", unit="1", default=1.0, lowest=0.2, highest=5.0,
                      summary="q of (time_loss t)^q"),
        ),
        source="torque-speed line of a DC motor at a fixed voltage; fade of a brake that warms",
        limits="cut at zero", hooks={"torque_factor": torque_fade_factor},
    ),
)  # fmt: skip
