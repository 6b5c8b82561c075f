"""The surface laws that are fitted, and their free parameters.

All but one are laws of `rigid.ground.laws.GROUNDS`, by whose own functions the force is computed. The last is that of
Katsuragi and Durian with the momentum of the grains that move along, for which a ground has no place: its force depends
on the acceleration. With m_a(z) = b z as the mass that moves along,

    F = k z + d(m_a v)/dt = k z + b v^2 + b z a.

Aguilar and Goldman (arXiv 1512.05762) found that such an added mass matters where a foot is accelerated. Their mass is
that of a cone of grains that stops growing. Only for the linear one here the term b v^2 is Katsuragi and Durian's own.
In drives at constant speed both laws are the same.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rigid.ground.laws import SurfaceLaw, find_law

from .data import Array, Data, Foundation

__all__ = ["ADDED_MASS", "CANDIDATES", "RATES", "Candidate", "candidates_for"]

ADDED_MASS = "katsuragi-durian-added-mass"
_ENDS = {"exponent": (0.3, 3.9), "dissipation": (-9.0, 9.0)}
"""Bounds of free parameters that may not be any number [1, s/m]."""
RATES = ("damping", "dissipation", "drag", "inertia")
"""Parameters of the rate. A fit may make them negative, so that their intervals are honest about 0."""


@dataclass(frozen=True)
class Candidate:
    """One law of a comparison."""

    name: str
    law: SurfaceLaw
    free: tuple[str, ...]
    fixed: Mapping[str, float]
    added_mass: bool = False

    @property
    def rate_parameter(self) -> str | None:
        """The free parameter of the rate term; None if there is none."""
        return next((name for name in self.free if name in RATES), None)

    def without_rate(self) -> "Candidate":
        """The same law with the rate parameter held at 0."""
        rate = self.rate_parameter
        assert rate is not None
        return replace(self, free=tuple(name for name in self.free if name != rate), fixed={**self.fixed, rate: 0.0})

    def values(self, theta: Array) -> dict[str, float]:
        """All parameters by name, with `theta` for the free ones."""
        return dict(self.fixed) | dict(zip(self.free, map(float, theta), strict=True))

    def numbers(self, theta: Array) -> tuple[float, ...]:
        """The law's numbers, without the checks that refuse a negative rate."""
        values = self.values(theta)
        return self.law.make(values) if self.law.make else tuple(values[slot] for slot in self.law.slots)

    def force(self, theta: Array, depth: Array, rate: Array, acceleration: Array | None = None) -> Array:
        """Force of loading [N], shape of `depth` [m]; `rate` in m/s and `acceleration` in m/s2, positive downwards."""
        p, law = self.numbers(theta), self.law
        pairs = zip(depth.tolist(), rate.tolist(), strict=True)
        force = np.array([law.loading(z, p) + law.rate_force(z, v, p) for z, v in pairs], dtype=float)
        if self.added_mass and acceleration is not None:
            force += self.values(theta)["drag"] * depth * acceleration
        return force

    def predict(self, theta: Array, data: Data) -> Array:
        """Force of loading at every bin of `data` [N], shape [row_count]."""
        return self.force(theta, data.depth, data.rate, data.acceleration)

    def depth_at(self, theta: Array, load: float, rate: float = 0.0, *, deepest: float = 1.0) -> float | None:
        """Depth at which the force of loading is `load` [N] at `rate` [m/s]; 0 if it is more at once, None if less
        down to `deepest` [m]."""
        p, law = self.numbers(theta), self.law

        def left(z: float) -> float:
            return float(law.loading(z, p) + law.rate_force(z, rate, p)) - load

        low, high = 1e-9, deepest
        if left(low) >= 0:
            return 0.0
        if left(high) < 0:
            return None
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if left(middle) >= 0 else (middle, high)
        return 0.5 * (low + high)

    def bounds(self) -> tuple[Array, Array]:
        """Smallest and largest value of each free parameter, shape [parameter_count]."""
        pairs = [_ENDS.get(name, (-np.inf, np.inf) if name in RATES else (0.0, np.inf)) for name in self.free]
        return np.array([low for low, _ in pairs]), np.array([high for _, high in pairs])

    def start(self, data: Data) -> Array:
        """A first guess from a straight line in log force over log depth, shape [parameter_count]."""
        rows = (data.force > 0) & (data.depth > 0)
        depth, force = data.depth[rows], data.force[rows]
        exponent = 1.0
        if len(depth) > 2 and np.ptp(depth) > 0:
            exponent = float(np.clip(np.polyfit(np.log(depth), np.log(force), 1)[0], 0.5, 2.5))
        guess: dict[str, float] = dict.fromkeys(self.free, 0.0)
        if "exponent" in guess:
            guess["exponent"] = exponent - (1.0 if self.name == "bekker" and self.fixed["tip_height"] > 0 else 0.0)
            guess["exponent"] = max(guess["exponent"], 0.35)
        strength = next(name for name in self.free if name not in (*RATES, "exponent"))
        guess[strength] = 1.0
        rate = self.rate_parameter
        if rate is not None:
            guess[rate] = {"inertia": 1.1}.get(rate, 0.0)
        theta = np.array([guess[name] for name in self.free])
        shape = self.force(theta, depth, np.zeros_like(depth))
        guess[strength] = float(shape @ force / (shape @ shape)) if len(depth) else 1.0
        if rate in ("damping", "drag"):
            fast = float(np.max(data.rate)) or 1.0
            guess[rate] = 0.1 * float(force.mean()) / fast ** (2 if rate == "drag" else 1)
        return np.array([guess[name] for name in self.free])


def _spring(foundation: Foundation) -> Candidate:
    return Candidate("spring-damper", find_law("spring-damper"), ("stiffness", "damping"), {})


def _hunt_crossley(foundation: Foundation) -> Candidate:
    free = ("stiffness", "dissipation", "exponent")
    return Candidate("hunt-crossley", find_law("hunt-crossley"), free, {})


def _power(foundation: Foundation) -> Candidate:
    law = find_law("power-irreversible")
    return Candidate(law.name, law, ("stiffness", "damping", "exponent"), {"rebound": law.values({})["rebound"]})


def _katsuragi(foundation: Foundation) -> Candidate:
    law = find_law("katsuragi-durian")
    return Candidate(law.name, law, ("stiffness", "drag"), {"rebound": law.values({})["rebound"]})


def _added_mass(foundation: Foundation) -> Candidate:
    of = _katsuragi(foundation)
    return Candidate(ADDED_MASS, of.law, of.free, of.fixed, added_mass=True)


def _bekker(foundation: Foundation) -> Candidate:
    law = find_law("bekker")
    own = {"radius": 0.5 * foundation.diameter, "tip_height": foundation.tip_height, "cohesive_modulus": 0.0}
    return Candidate(law.name, law, ("frictional_modulus", "exponent"), own | {"rebound": law.values({})["rebound"]})


def _rft(foundation: Foundation) -> Candidate | None:
    if foundation.tip != "sphere":
        return None
    law = find_law("rft")
    own = {"radius": 0.5 * foundation.diameter, "gravity": foundation.gravity}
    own["surface_friction"] = foundation.surface_friction
    defaults = law.values({})
    own |= {name: defaults[name] for name in ("friction", "rebound")}
    return Candidate(law.name, law, ("bulk_density", "inertia"), own)


CANDIDATES = {
    "spring-damper": _spring, "hunt-crossley": _hunt_crossley, "power-irreversible": _power,
    "katsuragi-durian": _katsuragi, ADDED_MASS: _added_mass, "bekker": _bekker, "rft": _rft,
}  # fmt: skip
"""Name -> function of a `Foundation` that gives the candidate, or None where the law is not for that tip."""


def candidates_for(data: Data, names: tuple[str, ...]) -> tuple[list[Candidate], dict[str, str]]:
    """The candidates of these names that `data` can be fitted by, and of the others name -> key of the reason."""
    found = {name: CANDIDATES[name](data.foundation) for name in names}
    left = {name: "not_for_tip" for name, candidate in found.items() if candidate is None}
    if ADDED_MASS in found and not any(run.kind == "drop" for run in data.runs):
        left[ADDED_MASS] = "no_drops"
    return [candidate for name, candidate in found.items() if candidate is not None and name not in left], left
