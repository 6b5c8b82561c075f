"""The numbers of one trial: platform, ground, rig, torque and effects, checked by name."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Literal

from rigid.checks import (
    Coulomb,
    check_above_zero,
    check_counterweight,
    check_friction,
    check_not_negative,
    check_simulated_gravity,
)
from rigid.ground.laws import SurfaceLaw, find_law
from rigid.terms import Term, find_effect, load_effect

__all__ = ["Effect", "Ground", "Trial"]

STANDARD_GRAVITY = 9.80665
POSITIVE = ("mass", "inertia", "spike_length", "gravity_sim", "gravity", "wheel_inertia")
"""Numbers of a trial that must be above 0."""


@dataclass(frozen=True, kw_only=True)
class Effect:
    """A term beyond the base model: its id, its parameters by name, and the file of one's own.

    Raises ValueError for an id, a parameter or a value that there cannot be.
    """

    id: str
    parameters: Mapping[str, float] = field(default_factory=dict)  # What differs from the defaults
    file: str | Path | None = None  # The Python file that defines a term of one's own (`rigid.terms.load_effect`)

    def __post_init__(self) -> None:
        if self.file is not None and self.term.id != self.id:
            raise ValueError(f"effect {self.id!r}: the TERM in {str(self.file)!r} is called {self.term.id!r}")
        self.values  # noqa: B018  (checks)

    def __hash__(self) -> int:
        return hash((self.id, tuple(sorted(self.parameters.items())), str(self.file)))

    @cached_property
    def term(self) -> Term:
        """The term itself."""
        return find_effect(self.id) if self.file is None else load_effect(self.file)

    @cached_property
    def values(self) -> dict[str, float]:
        """All its parameters, as given or by default."""
        return self.term.values(self.parameters)


@dataclass(frozen=True, kw_only=True)
class Ground:
    """What computes the force on a tip: one of `rigid.ground.laws.GROUNDS` with its parameters, for one row of
    spikes."""

    name: str = "spring-damper"
    parameters: Mapping[str, float] = field(default_factory=dict)
    """By the law's names; what is left out is the law's default."""
    spikes_per_row: float = 1.0
    """How many spikes press side by side, if the parameters are those of one; 1 where they are a row's."""

    def __post_init__(self) -> None:
        self.law.values(self.parameters)
        check_above_zero(spikes_per_row=self.spikes_per_row)

    @property
    def law(self) -> SurfaceLaw:
        """The law itself."""
        return find_law(self.name)

    @property
    def numbers(self) -> tuple[float, ...]:
        """The law's numbers for a row."""
        return self.law.numbers(self.parameters, count=self.spikes_per_row)

    @property
    def rebound(self) -> float:
        """Share of the deepest depth that springs back [1]; 1 for a law without memory."""
        return self.law.rebound(self.parameters) or 1.0

    @property
    def memory(self) -> tuple[float, float, float]:
        """`rebound`, and `loss` [1] and `loss_speed` [m/s] on retreat; 1 and no loss for a law without memory."""
        return (self.rebound, *self.law.loss(self.parameters))


@dataclass(frozen=True, kw_only=True)
class Trial(Coulomb):
    """One tumble. The names are those of a measured trial; SI units; stiffness and damping are a row's.

    Raises ValueError, naming the key, the value found and what was expected. Refused are mass or inertia that no body
    can have (above m l^2, or not above J_w) and a counterweight that is not lighter than the platform. So are friction
    with mu_d above mu_s and a brake without a spinning wheel.
    """

    mass: float = 5.3  # m [kg], wheels included
    inertia: float = 0.06  # J [kg m2] about the axis of rotation, with the wheels' mass and without their spin
    spike_length: float = 0.2  # l [m], from the centre to a tip
    spike_count: int = 8  # Rows of spikes, at equal angles
    stiffness: float = 1.5e4  # K [N/m]
    damping: float = 60.0  # C [N s/m], while a tip goes in
    mu_s: float = 0.5  # Coefficient of static friction [1]
    mu_d: float | None = None  # Coefficient of sliding friction [1]; None: half of mu_s
    gravity_sim: float  # g_sim [m/s2]: the weight on the surface is (mass + counterweight) gravity_sim
    gravity: float = STANDARD_GRAVITY
    """Local gravity [m/s2]: in the rig, what pulls at the centre of mass and on the wires."""
    counterweight: float = 0.0  # m_b [kg]; 0: no rig
    torque: float = 0.0  # tau [N m] on the platform, never negative
    torque_until: float = math.inf  # When it ends [s]
    actuator: Literal["motor", "brake"] = "motor"
    wheel_inertia: float = 1.2e-3  # J_w [kg m2]
    wheel_speed_0: float = 0.0  # Speed of the wheel at t = 0 [rad/s]
    effects: tuple[Effect, ...] = ()  # Terms beyond the base model
    ground: Ground | None = None  # What computes the force; None: the spring-damper of `stiffness` and `damping`

    def __post_init__(self) -> None:
        object.__setattr__(self, "effects", tuple(self.effects))
        positive = [*POSITIVE]
        others = ["damping", "mu_s", "counterweight", "torque", "wheel_speed_0"]
        (positive if self.ground is None else others).append("stiffness")
        if self.mu_d is not None:
            others.append("mu_d")
        check_above_zero(**{key: getattr(self, key) for key in positive})
        check_not_negative(**{key: getattr(self, key) for key in others})
        for key in positive + others:
            object.__setattr__(self, key, float(getattr(self, key)))
        check_friction(self.mu_s, self.mu_d)
        if type(self.spike_count) is not int or not 3 <= self.spike_count <= 30:
            raise ValueError(f"spike_count = {self.spike_count!r} must be a whole number from 3 to 30")
        most = self.mass * self.spike_length**2
        if self.inertia > most:
            raise ValueError(
                f"inertia = {self.inertia:g} kg m2 must not exceed mass spike_length^2 = {most:g} kg m2: no body of "
                f"{self.mass:g} kg within {self.spike_length:g} m has more"
            )
        if self.wheel_inertia >= most:
            raise ValueError(
                f"wheel_inertia = {self.wheel_inertia:g} kg m2 must be below mass spike_length^2 = {most:g} kg m2, the "
                f"most that a whole platform of {self.mass:g} kg within {self.spike_length:g} m can have"
            )
        if self.wheel_inertia >= self.inertia:
            raise ValueError(
                f"inertia = {self.inertia:g} kg m2 must exceed wheel_inertia = {self.wheel_inertia:g} kg m2: it leaves "
                f"this wheel's spin out, but holds the two wheels across it, J_w / 2 each at least, and all the rest"
            )
        check_counterweight(self.mass, self.counterweight)
        if self.counterweight > 0:
            check_simulated_gravity(self.gravity, gravity_sim=self.gravity_sim)
        if self.actuator not in ("motor", "brake"):
            raise ValueError(f"actuator = {self.actuator!r} must be 'motor' or 'brake'")
        if math.isnan(self.torque_until) or self.torque_until < 0:
            raise ValueError(f"torque_until = {self.torque_until} must be 0 or more (in s)")
        object.__setattr__(self, "torque_until", float(self.torque_until))
        if self.actuator == "brake" and self.torque > 0 and self.wheel_speed_0 == 0:
            raise ValueError("wheel_speed_0 = 0 must be above 0 (rad/s) for a brake: it slows a wheel that spins")
        seen: set[str] = set()
        for effect in self.effects:
            if effect.id in seen:
                raise ValueError(f"effects has {effect.id!r} twice")
            seen.add(effect.id)
            if effect.term.needs_rig and self.counterweight == 0:
                raise ValueError(f"effect {effect.id!r} needs a rig: counterweight = 0 must be above 0 (kg)")
        law, crater = self.ground.law if self.ground else None, self.effect_values("plastic-sinkage")
        if law and law.has_memory and crater:
            for key in ("bend", "open"):
                if crater[key]:
                    raise ValueError(
                        f"plastic-sinkage.{key} = {crater[key]:g} must be 0 on ground {law.name!r}, whose unloading "
                        "has a curve of its own"
                    )
        offset = self.effect_values("com-offset")
        if offset and self.mass * (offset["x"] ** 2 + offset["y"] ** 2) >= self.inertia:
            raise ValueError(
                f"com-offset.x = {offset['x']:g} m, com-offset.y = {offset['y']:g} m are too far off the shaft for "
                f"inertia = {self.inertia:g} kg m2 about it: less than sqrt(J / m) = "
                f"{math.sqrt(self.inertia / self.mass):.4g} m together is accepted"
            )

    def __repr__(self) -> str:
        rig = f" in a rig with {self.counterweight:g} kg" if self.counterweight else ""
        more = "".join(f", {effect.id}" for effect in self.effects)
        return (
            f"Trial({self.mass:g} kg on {self.spike_count} rows of {self.spike_length:g} m under {self.gravity_sim:g} "
            f"m/s2{rig}, {self.actuator} of {self.torque:g} N m, on {self.surface.name}{more})"
        )

    def effect_values(self, id: str) -> dict[str, float] | None:
        """All parameters of the effect `id`, None where it is off."""
        for effect in self.effects:
            if effect.id == id:
                return effect.values
        return None

    @property
    def weight(self) -> float:
        """W [N] on the surface."""
        return (self.mass + self.counterweight) * self.gravity_sim

    @property
    def height(self) -> float:
        """Of the centre above the tips that it stands on [m]: l cos(pi / n) for n rows of spikes."""
        return self.spike_length * math.cos(math.pi / self.spike_count)

    @property
    def tipping_torque(self) -> float:
        """Least torque that tips the base model from rest [N m] where it comes up slowly: W l sin(pi / n)."""
        return self.weight * self.spike_length * math.sin(math.pi / self.spike_count)

    @property
    def slip_torque(self) -> float:
        """Least torque that makes the base model slip at rest [N m] where it is there at once.

        The springs have not moved yet: the platform turns about the line of its feet, h below the centre. Holding them
        takes m h tau / (J + m h^2) of mu_s W. So mu_s W (J + m h^2) / (m h), in the rig too, where x has no more
        inertia than m.
        """
        h = self.height
        return self.mu_s * self.weight * (self.inertia + self.mass * h * h) / (self.mass * h)

    @property
    def pull_at_mass(self) -> float:
        """The gravity [m/s2] that pulls at the centre of mass: the true one, also in the rig."""
        return self.gravity if self.counterweight > 0 else self.gravity_sim

    @property
    def surface(self) -> Ground:
        """The ground, as given or by default."""
        if self.ground is not None:
            return self.ground
        return Ground(parameters={"stiffness": self.stiffness, "damping": self.damping})

    @property
    def terms(self) -> tuple[Term, ...]:
        """The terms of its effects, in their order."""
        return tuple(effect.term for effect in self.effects)

    def effect_numbers(self) -> dict[str, float]:
        """The fields of `p` (`rigid.model.model.parameter_names`) with their values."""
        from .model import parameter_names

        numbers = [value for effect in self.effects if not effect.term.sensor for value in effect.values.values()]
        return dict(zip(parameter_names(self.terms), (*numbers, *self.surface.memory), strict=True))
