"""Surface laws that stand in for a bed of grains. Each is a *ground* (see `coupling.ground`): stepped, saved, restored.

Here is the paper's spring-damper (Reid et al., i-SAIRAS 2014, eqs 5 and 6). A law sees a body as one point that goes
in: depth is positive downwards from `surface`.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .reaction import Contact, Reaction

__all__ = ["SpringDamper"]


@dataclass(frozen=True, kw_only=True)
class SpringDamper:
    """Spring with V = K z^2 / 2 in the surface, damper with D = C (dz/dt)^2 / 2 while going in only.

    The force on the body is K z + C max(0, dz/dt) for z > 0 and 0 above, so it never pulls. It keeps no memory.
    Raises ValueError for a negative stiffness or damping, or friction coefficients with mu_d above mu_s.
    """

    stiffness: float
    """K [N/m]."""
    damping: float = 0.0
    """C [N s/m], while going in."""
    mu_s: float = 0.5
    """Coefficient of static friction [1]."""
    mu_d: float | None = None
    """Coefficient of sliding friction [1]; None: half of mu_s."""
    surface: float = 0.0
    """Height of the surface [m]."""
    time_step: float = 1e-4
    """The step it is to be driven at [s]: the law itself is exact at any."""
    centre: tuple[float, float] = (0.0, 0.0)
    """Where a body is put by default [m]; the surface is the same everywhere."""
    name: str = "spring-damper"

    @property
    def clearance(self) -> float:
        """How far above `surface` a body touches nothing [m]: the surface is flat, so 0."""
        return 0.0

    @property
    def depth_limit(self) -> float:
        """How deep a body may go [m]: there is no floor."""
        return math.inf

    def __post_init__(self) -> None:
        for key in ("stiffness", "damping", "mu_s"):
            value = getattr(self, key)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{key} is {value}: it must be 0 or more")
        if self.mu_d is not None and not 0 <= self.mu_d <= self.mu_s:
            raise ValueError(f"mu_d is {self.mu_d}: it must be from 0 to mu_s, {self.mu_s}")
        if not (math.isfinite(self.time_step) and self.time_step > 0):
            raise ValueError(f"time_step is {self.time_step}: it must be above 0 (in s)")

    def describe(self) -> dict[str, Any]:
        """What it is, in plain numbers, for run.toml."""
        return {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(self).items()}

    def force(self, depth: ArrayLike, velocity: ArrayLike) -> np.ndarray:
        """Upward force on the body [N] at `depth` [m] and `velocity` [m/s], both positive downwards, any one shape."""
        z, rate = np.asarray(depth, dtype=float), np.asarray(velocity, dtype=float)
        return np.where(z > 0, self.stiffness * z + self.damping * np.maximum(rate, 0.0), 0.0)

    def step(self, position: ArrayLike, velocity: ArrayLike, dt: float) -> Reaction:
        """Mean reaction over `dt` [s] on a body whose tip starts at `position` [m], at constant `velocity` [m/s].

        Both have shape (3,), z up. The mean is taken exactly over the path, so force * dt is the exact impulse and
        force * displacement the exact change of the spring's energy plus what the damper takes.
        """
        at, rate = np.asarray(position, dtype=float), np.asarray(velocity, dtype=float)
        start, sinking = self.surface - at[2], -rate[2]
        end = start + sinking * dt
        low, high = min(start, end), max(start, end)
        inside = 1.0 if low > 0 else (high / (high - low) if high > 0 else 0.0)  # share of dt spent in the surface
        mean_depth = 0.5 * (max(low, 0.0) + max(high, 0.0)) * inside
        normal = self.stiffness * mean_depth + self.damping * max(sinking, 0.0) * inside
        if normal == 0.0:
            return Reaction(np.zeros(3), np.zeros(3))
        mu_d = 0.5 * self.mu_s if self.mu_d is None else self.mu_d
        contact = Contact(at.copy(), normal, mu_s=self.mu_s, mu_d=mu_d)
        return Reaction(np.array([0.0, 0.0, normal]), np.zeros(3), (contact,))

    def state(self) -> dict[str, Any]:
        """Nothing: the law has no memory."""
        return {}

    def restore(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave."""
