"""Surface laws as grounds (`coupling.ground.Ground`) under a body of one member, a point: stepped, saved, restored.

Depth is positive downwards from `surface`. All laws of `rigid.ground.laws` share one class; `SpringDamper` is the
paper's law, with its two numbers as arguments. `coupling.LawGround` puts one under each member of a platform.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from rigid.checks import Coulomb, check_above_zero, check_friction

from .laws import SurfaceLaw, find_law, retreat_share
from .reaction import Contact, Facts, Reaction, State, Turned

__all__ = ["SpringDamper", "SurfaceGround"]

SHORT = 1e-3
"""Below this share of the depth a path is integrated by Simpson's rule, exact to round-off there. A difference of works
would lose digits."""


@dataclass(frozen=True, kw_only=True)
class _LawGround(Coulomb):
    """What all grounds with a surface law share. `_setting` says which law and with which parameters."""

    mu_s: float = 0.5  # Coefficient of static friction [1]
    mu_d: float | None = None  # Coefficient of sliding friction [1]; None: half of mu_s
    surface: float = 0.0  # Height of the surface [m]
    time_step: float = 1e-4  # The step it is to be driven at [s]: the law itself is exact at any
    centre: tuple[float, float] = (0.0, 0.0)  # Where a body is put by default [m]; the surface is the same everywhere
    name: str = ""  # What a report calls it; the law's name if not given
    count: float = 1.0  # How many times the law it is, as of several spikes side by side [1]
    lag: ClassVar[float] = 0.0  # The mean force over a step belongs to the step's middle
    gives_friction: ClassVar[bool] = False  # The horizontal force is a Coulomb bound, which the body resolves
    clearance: ClassVar[float] = 0.0  # How far above `surface` a body touches nothing [m]: the surface is flat
    depth_limit: ClassVar[float] = math.inf  # How deep a body may go [m]: there is no floor
    _law: SurfaceLaw = field(init=False, repr=False, compare=False)
    _numbers: tuple[float, ...] = field(init=False, repr=False, compare=False)
    _rebound: float = field(init=False, repr=False, compare=False)
    _loss: tuple[float, float] = field(init=False, repr=False, compare=False)
    _deepest: list[float] = field(init=False, repr=False, compare=False)
    _depth: list[float] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        law_name, parameters = self._setting()
        law = find_law(law_name)
        check_friction(self.mu_s, self.mu_d)
        check_above_zero("in s", time_step=self.time_step)
        check_above_zero("1", count=self.count)
        numbers = law.numbers(parameters, count=self.count)
        values = {"_law": law, "_numbers": numbers, "_rebound": law.rebound(parameters) or 1.0}
        values["_loss"] = law.loss(parameters)
        for key, value in (values | {"_deepest": [0.0], "_depth": [0.0], "name": self.name or law.name}).items():
            object.__setattr__(self, key, value)

    def _setting(self) -> tuple[str, Mapping[str, float]]:
        raise NotImplementedError

    def __repr__(self) -> str:
        units = {parameter.name: f" {parameter.unit}".removesuffix(" 1") for parameter in self._law.parameters}
        values = self._law.values(self._setting()[1])
        numbers = ", ".join(f"{key} = {value:g}{units[key]}" for key, value in values.items())
        return f"{type(self).__name__}({self.name}: {numbers}, mu_s = {self.mu_s:g})"

    @property
    def deepest(self) -> float:
        """How deep the body has been since it last left the surface [m]; 0 for a law without memory."""
        return self._deepest[0]

    @property
    def retreat_damping(self) -> float:
        """Damping on retreat over the springback's force, from rest: loss / loss_speed [s/m]."""
        return self._loss[0] / self._loss[1]

    def describe(self) -> Facts:
        """What it is, in plain numbers, for run.toml."""
        own = self._law.values(self._setting()[1])
        common = {key: getattr(self, key) for key in ("mu_s", "mu_d", "surface", "time_step")}
        return own | common | {"centre": list(self.centre), "name": self.name}

    def force(self, depth: ArrayLike, velocity: ArrayLike) -> np.ndarray:
        """Upward force on the body [N] at `depth` [m] and `velocity` [m/s], both positive downwards, any one shape.

        For a law with memory each depth is taken as the deepest: loading.
        """
        z, rate = np.broadcast_arrays(np.asarray(depth, dtype=float), np.asarray(velocity, dtype=float))
        flat = [self._law.force(a, b, self._numbers) for a, b in zip(z.flat, rate.flat, strict=True)]
        return np.array(flat, dtype=float).reshape(z.shape)

    def stored(self, depth: float) -> float:
        """Energy stored in the surface [J] with the body at `depth` [m] after the steps made so far."""
        return self._law.stored(depth, self._numbers, top=self._deepest[0], rebound=self._rebound)

    def step(
        self, position: ArrayLike, velocity: ArrayLike, dt: float, turn: Turned = None, spin: Turned = None
    ) -> Reaction:
        """Mean reaction over `dt` [s] on a body whose tip starts at `position` [m], at constant `velocity` [m/s].

        Both have shape (3,), z up; the body is a point, so that `turn` and `spin` are of no effect. The mean is taken
        exactly over the path, so force * dt is the exact impulse. Force * displacement is the exact change of the
        stored energy plus what is dissipated.
        """
        at, rate = np.asarray(position, dtype=float), np.asarray(velocity, dtype=float)
        start, sinking = float(self.surface - at[2]), float(-rate[2])
        end = start + sinking * dt
        normal = self._mean(start, end, sinking)
        self._depth[0] = end
        if self._law.has_memory:
            self._deepest[0] = max(self._deepest[0], start, end) if end > 0.0 else 0.0
        if normal == 0.0:
            return Reaction(np.zeros(3), np.zeros(3))
        contact = Contact(at.copy(), normal, mu_s=self.mu_s, mu_d=self.sliding_friction)
        return Reaction(np.array([0.0, 0.0, normal]), np.zeros(3), (contact,))

    def energies(self) -> dict[str, float]:
        """In the surface after the steps made so far [J]."""
        return {"springs": self.stored(self._depth[0]) if self._depth[0] > 0 else 0.0}

    def state(self) -> State:
        """The deepest depth, where the law remembers it; otherwise nothing."""
        return {"deepest": np.array(self._deepest[0])} if self._law.has_memory else {}

    def restore(self, state: State) -> None:
        """Go back to what `state` gave."""
        self._deepest[0] = float(state["deepest"]) if self._law.has_memory else 0.0

    def checkpoint(self) -> State:
        """The state that `rollback` goes back to."""
        return self.state()

    def rollback(self, kept: State) -> None:
        """Go back to what `checkpoint` gave."""
        self.restore(kept)

    def _mean(self, start: float, end: float, rate: float) -> float:
        """Mean force on the way from depth `start` to `end` [m] at `rate` [m/s]."""
        law, p, low, high = self._law, self._numbers, max(min(start, end), 0.0), max(start, end)
        if high <= 0.0:
            return 0.0
        deepest = max(self._deepest[0], start) if law.has_memory else 0.0
        if start == end:
            return law.force(start, rate, p, top=deepest, rebound=self._rebound, loss=self._loss)
        impulse = self._integral(lambda z: law.rate_force(z, rate, p), lambda z: law.rate_work(z, rate, p), low, high)
        turn = min(max(low, deepest), high)  # below it the depths are new
        impulse += self._integral(lambda z: law.loading(z, p), lambda z: law.loading_work(z, p), turn, high)
        if low < turn:
            ends = sorted({low, turn, min(max(low, deepest * (1.0 - self._rebound)), turn)})
            forces = [law.force(z, 0.0, p, top=deepest, rebound=self._rebound) for z in ends]
            pieces = pairwise(zip(ends, forces, strict=True))  # straight lines: the trapezium is exact
            whole = sum(0.5 * (b - a) * (force_a + force_b) for (a, force_a), (b, force_b) in pieces)
            impulse += whole * retreat_share(rate, *self._loss)
        return max(0.0, impulse / abs(end - start))

    def _integral(self, force: Callable[..., Any], work: Callable[..., Any], low: float, high: float) -> float:
        """Integral of `force` from `low` to `high` [m], whose primitive is `work`."""
        if high <= low:
            return 0.0
        inside = [self._numbers[k] for k in self._law.bends if low < self._numbers[k] < high]
        ends, total = [low, *sorted(inside), high], 0.0
        for a, b in pairwise(ends):
            if b - a < SHORT * b:
                total += (b - a) / 6.0 * (force(a) + 4.0 * force(0.5 * (a + b)) + force(b))
            else:
                total += work(b) - work(a)
        return float(total)


@dataclass(frozen=True, kw_only=True, repr=False)
class SurfaceGround(_LawGround):
    """Any law of `rigid.ground.laws.GROUNDS` as a ground, such as SurfaceGround(law="bekker",
    parameters={"exponent": 1.0}).

    The force never pulls. Grains (the laws with `rebound`) remember how deep the body has been, until it leaves the
    surface. Raises ValueError for a law there is not, for a parameter that cannot be, and for mu_d above mu_s.
    """

    law: str  # Name of the law
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Its parameters by name, SI units; those not given have their defaults."""

    def _setting(self) -> tuple[str, Mapping[str, float]]:
        return self.law, self.parameters


@dataclass(frozen=True, kw_only=True, repr=False)
class SpringDamper(_LawGround):
    """Spring with V = K z^2 / 2 in the surface, damper with D = C (dz/dt)^2 / 2 while going in only.

    The force on the body is K z + C max(0, dz/dt) for z > 0 and 0 above. It never pulls (Reid et al., i-SAIRAS 2014,
    eqs 5 and 6). It keeps no memory. Raises ValueError for a negative stiffness or damping, or mu_d above mu_s.
    """

    stiffness: float  # K [N/m]
    damping: float = 0.0  # C [N s/m], while going in

    def _setting(self) -> tuple[str, Mapping[str, float]]:
        return "spring-damper", {"stiffness": self.stiffness, "damping": self.damping}
