"""The gravity-offloading rig: an Atwood machine that carries most of the platform's weight.

A counterweight m_b hangs on wires over pulleys and moves up as the platform moves down (dy_b/dt = -dy/dt). The weight
left on the surface is W = (m + m_b) g_sim; the inertia in y is m + m_b, in x it is m. Source: the Lagrangian of the
pair in Reid, Roveda, Nesnas and Pavone (i-SAIRAS 2014), eqs 17 to 19, whose "0.0085 g" can be read in two ways:

- ``pair``: the free-fall acceleration of the pair, g_sim = g (m - m_b) / (m + m_b);
- ``weight``: the weight that is left, per mass of the platform, g (m - m_b) / m.

The two are almost a factor of two apart.
"""

from dataclasses import dataclass
from typing import Literal, get_args

from rigid.checks import check_above_zero, check_counterweight, check_simulated_gravity

__all__ = ["STANDARD_GRAVITY", "Reading", "Rig", "counterweight_for"]

STANDARD_GRAVITY = 9.80665  # Standard gravity [m/s2], the unit of ``--rig``

Reading = Literal["pair", "weight"]  # What a stated gravity of the rig means


def counterweight_for(
    mass: float, gravity_stated: float, *, gravity: float = STANDARD_GRAVITY, reading: Reading = "pair"
) -> float:
    """The counterweight [kg] that offloads a platform of `mass` [kg] to `gravity_stated` [m/s2].

    Read as ``pair``, m_b = m (g - g_sim) / (g + g_sim); as ``weight``, m_b = m (1 - g_stated / g). Raises ValueError,
    naming the argument, for an impossible mass, gravity or reading. It also refuses a stated gravity that is not below
    the local one, `gravity` [m/s2]: a counterweight can only take weight away.
    """
    if reading not in get_args(Reading):
        raise ValueError(f"reading = {reading!r} is neither 'pair' nor 'weight'")
    check_above_zero("kg", mass=mass)
    check_above_zero("m/s2", gravity=gravity, gravity_stated=gravity_stated)
    check_simulated_gravity(gravity, gravity_stated=gravity_stated)
    if reading == "pair":
        return mass * (gravity - gravity_stated) / (gravity + gravity_stated)
    return mass * (1 - gravity_stated / gravity)


@dataclass(frozen=True, kw_only=True)
class Rig:
    """A platform in the rig. `gravity_sim` rules the weight, whatever (m - m_b) g would give.

    Raises ValueError, naming the key, its value and the allowed range. A counterweight must be lighter than the
    platform (else it pulls it off the ground), a simulated gravity below the local one.
    """

    mass: float  # Of the platform [kg]
    counterweight: float  # m_b [kg]
    gravity_sim: float  # Free-fall acceleration of the pair [m/s2]
    gravity: float = STANDARD_GRAVITY  # Local gravity [m/s2]
    wire_length: float | None = None  # From the pulley down to the shaft [m]; for the pendulum of the wires

    def __post_init__(self) -> None:
        check_above_zero("kg", mass=self.mass, counterweight=self.counterweight)
        check_above_zero("m/s2", gravity=self.gravity, gravity_sim=self.gravity_sim)
        if self.wire_length is not None:
            check_above_zero("m", wire_length=self.wire_length)
        check_counterweight(self.mass, self.counterweight)
        check_simulated_gravity(self.gravity, gravity_sim=self.gravity_sim)

    @classmethod
    def offloading(
        cls, mass: float, gravity_stated: float, *, reading: Reading = "pair", counterweight: float | None = None,
        gravity: float = STANDARD_GRAVITY, wire_length: float | None = None,
    ) -> "Rig":  # fmt: skip
        """The rig that a stated gravity [m/s2] means for a platform of `mass` [kg].

        Without `counterweight` [kg] it is the one that gives that gravity. With one, the stated gravity still rules the
        weight: W = (m + m_b) g_stated read as ``pair``, W = m g_stated read as ``weight``.
        """
        if counterweight is None:
            counterweight = counterweight_for(mass, gravity_stated, gravity=gravity, reading=reading)
        elif reading not in get_args(Reading):
            raise ValueError(f"reading = {reading!r} is neither 'pair' nor 'weight'")
        share = 1.0 if reading == "pair" else mass / (mass + counterweight)
        return cls(
            mass=mass, counterweight=counterweight, gravity_sim=gravity_stated * share, gravity=gravity,
            wire_length=wire_length,
        )  # fmt: skip

    @property
    def weight(self) -> float:
        """What rests on the surface, (m + m_b) g_sim [N]."""
        return (self.mass + self.counterweight) * self.gravity_sim

    @property
    def balance(self) -> float:
        """The counterweight [kg] at which (m - m_b) g is the weight that gravity_sim says."""
        return self.mass * (self.gravity - self.gravity_sim) / (self.gravity + self.gravity_sim)

    def wire_tension(self, vertical_acceleration: float = 0.0) -> float:
        """Tension of the wires [N] while the platform accelerates upwards [m/s2]: m_b (g - y'').

        The counterweight's own equation, m_b y_b'' = T - m_b g with y_b'' = -y''. At rest m_b g; in a free hop
        (y'' = -g_sim) m_b (g + g_sim). Never below zero: a wire does not push.
        """
        return max(0.0, self.counterweight * (self.gravity - vertical_acceleration))
