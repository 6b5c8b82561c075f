"""Surface laws: the force on a spike by its depth, its rate of sinking and, for grains, its deepest depth.

Each law is a few plain functions of numbers (`rigid.ground.law_functions`). Their source runs as Python and, compiled
by the caller (`ti.func`), on thousands of trials at once. Depth z is positive downwards from the surface, rate is
dz/dt. With `p` the law's numbers (a tuple, or a vector, in the order of `SurfaceLaw.slots`), the force, never negative,
is

    force = loading(top, p) * springback(z, top, rebound) * retreat_share(rate, *loss) + rate_force(z, rate, p)

- `loading` is the force of loading, at new depths, and `loading_work` its integral from 0.
- A law without memory springs back whole: there top = z, and springback(z, z, .) = 1. Grains do not: for them top is
  the deepest depth that this spike has reached here (top >= z; 0 again once it has left the surface). The force falls
  in a straight line to 0 while the share `rebound` of that depth is undone. On retreat it is smaller by the factor 1 -
  loss u / (u + loss_speed), u the speed of retreat. So a cycle of unloading and loading again at u loses that share of
  its work. It is continuous at u = 0; `loss` = 0 is a springback without loss.
- `rate_force` is what depends on the rate (it may be negative, never below -loading). `rate_work` is its integral over
  depth at a constant rate.

What is stored: loading_work(z) without memory, else `springback_energy`. All other work of the force is dissipated:
at every moment force * rate >= d(stored)/dt, as `tests/rigid/ground/test_laws.py` shows for each law.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from rigid.checks import Parameter, check_parameters

from . import law_functions as fn
from .law_functions import retreat_share, springback, springback_energy
from .rft import ball_profile, stress_gradient
from .rft_foot import foot_profile

__all__ = [
    "FOOT_LAWS", "GROUNDS", "NO_LOSS", "Parameter", "SurfaceLaw", "find_law", "katsuragi_durian", "retreat_share",
    "springback", "springback_energy",
]  # fmt: skip

EARTH_GRAVITY = 9.80665  # Standard gravity, that of the defaults [m/s2]
NEAR_1_G = 0.1
"""Relative difference from 1 g up to which defaults without a rule are used [1]: tables of moduli scatter by more."""
NO_LOSS = (0.0, 1.0)  # `loss` and `loss_speed` of a law that loses nothing on retreat
Numbers = Any  # A law's numbers: anything that p[0], p[1] ... can be read from.

MEMORY = (
    "ours: a bed of sand computed with this package returns nothing that can be measured (work_returned_dem of "
    "docs/results/penetrate is below 0.01), and a twentieth is about the stiffest unloading that a 1 ms step follows"
)

LOSS = (
    "ours: 0 is a springback without loss. Swings in a crater in beds of softened grains have loss = 1 and "
    "loss_speed = 0.12 m/s +- 0.01, stiffer grains a smaller loss_speed (docs/results/foot-cycles)"
)


@dataclass(frozen=True, kw_only=True)
class SurfaceLaw:
    """One law: its parameters, what turns them into numbers, and its functions (see the module)."""

    name: str
    summary: str
    source: str
    parameters: tuple[Parameter, ...]
    slots: tuple[str, ...]  # What stands in p[0], p[1] ... of the functions.
    extensive: tuple[int, ...]  # Which of them are in proportion to the number of spikes that press side by side
    make: Callable[[Mapping[str, float]], tuple[float, ...]] | None = None  # None: the parameters of those names
    loading: Callable[..., Any]
    loading_work: Callable[..., Any]
    rate_force: Callable[..., Any]
    rate_work: Callable[..., Any]
    has_memory: bool  # Whether it takes the deepest depth and the parameter `rebound`
    bends: tuple[int, ...] = ()  # Slots that hold depths at which the functions bend [m], for those who integrate them
    gravity_powers: Mapping[str, float] = field(default_factory=dict, hash=False)
    """Name of a parameter -> power of gravity that its default is in proportion to. The defaults are of 1 g."""
    of_one_g: tuple[str, ...] = ()  # Parameters whose defaults are of 1 g and follow no known rule

    def values(self, given: Mapping[str, float]) -> dict[str, float]:
        """All parameters, as given or by default. Raises ValueError as `check_parameters`."""
        known = [parameter.name for parameter in self.parameters]
        if unknown := [key for key in given if key not in known]:
            raise ValueError(f"{unknown[0]} is no parameter of {self.name}: there is {', '.join(known)}")
        return check_parameters(self.parameters, given, self.name)

    def in_gravity(self, gravity: float, given: Mapping[str, float]) -> dict[str, float]:
        """`given`, and what of the defaults follows this gravity of the grains [m/s2] (`gravity_powers`).

        Raises ValueError, naming them, where parameters of `of_one_g` are left at their defaults in a gravity that
        differs from 1 g by more than `NEAR_1_G`.
        """
        left = [name for name in self.of_one_g if name not in given]
        powers = {name: power for name, power in self.gravity_powers.items() if name not in given}
        share = gravity / EARTH_GRAVITY
        if powers and not gravity > 0:
            raise ValueError(
                f"gravity = {gravity:g} m/s2: {' and '.join(powers)} of {self.name} follow the weight of the grains, "
                f"so gravity must be above 0, or give them"
            )
        if left and abs(share - 1) > NEAR_1_G:
            raise ValueError(
                f"gravity = {gravity:.4g} m/s2: the defaults of {' and '.join(left)} of {self.name} are of 1 g, and "
                f"the source of the law has no rule for another gravity: give these parameters, or use rft"
            )
        own = {p.name: gravity for p in self.parameters if p.name == "gravity"}
        own |= {p.name: p.default * share ** powers[p.name] for p in self.parameters if p.name in powers}
        return own | dict(given)

    def numbers(self, given: Mapping[str, float], *, count: float = 1.0) -> tuple[float, ...]:
        """p of the functions for these parameters, of `count` spikes side by side. Raises ValueError as `values`."""
        values = self.values(given)
        p = tuple(values[slot] for slot in self.slots) if self.make is None else self.make(values)
        return tuple(count * value if k in self.extensive else value for k, value in enumerate(p))

    def rebound(self, given: Mapping[str, float]) -> float | None:
        """Share of the deepest depth that springs back [1], above 0; None for a law without memory."""
        return self.values(given)["rebound"] if self.has_memory else None

    def loss(self, given: Mapping[str, float]) -> tuple[float, float]:
        """`loss` [1] and `loss_speed` [m/s] of `retreat_share`; `NO_LOSS` for a law without memory."""
        values = self.values(given)
        return (values["loss"], values["loss_speed"]) if self.has_memory else NO_LOSS

    def force(
        self,
        depth: float,
        rate: float,
        p: Numbers,
        *,
        top: float | None = None,
        rebound: float = 1.0,
        loss: tuple[float, float] = NO_LOSS,
    ) -> float:
        """Force [N] at `depth` [m] and `rate` [m/s], both positive downwards; `top` is the deepest depth so far [m].

        Without `top`, `depth` is the deepest. `loss`: as the method of that name returns it.
        """
        if depth <= 0.0:
            return 0.0
        top = depth if top is None or not self.has_memory else max(top, depth)
        elastic = self.loading(top, p) * springback(depth, top, rebound) * retreat_share(rate, *loss)
        return float(elastic + self.rate_force(depth, rate, p))

    def stored(self, depth: float, p: Numbers, *, top: float | None = None, rebound: float = 1.0) -> float:
        """Energy stored in the surface [J]."""
        if not self.has_memory:
            return float(self.loading_work(depth, p))
        top = max(depth, 0.0) if top is None else max(top, depth, 0.0)
        return float(springback_energy(depth, top, rebound, self.loading(top, p)))


def find_law(name: str) -> SurfaceLaw:
    """The law called `name`, of `GROUNDS` or `FOOT_LAWS`. Raises ValueError naming those of `GROUNDS`."""
    if name in FOOT_LAWS:
        return FOOT_LAWS[name]
    if name not in GROUNDS:
        raise ValueError(f"there is no surface law {name!r}: there is {', '.join(GROUNDS)}")
    return GROUNDS[name]


def katsuragi_durian(
    *, diameter: float, projectile_density: float, bulk_density: float, friction: float, gravity: float
) -> dict[str, float]:
    """Stiffness [N/m] and drag [kg/m] of a ball of `diameter` [m] and density in grains of `bulk_density` [kg/m3].

    k D / (m g) = 12 mu (rho_g / rho_p)^(1/2) and d_1 / D = (0.25 / mu) rho_p / rho_g: Katsuragi and Durian, Physical
    Review E 87, 052208 (2013). The scalings are those of its abstract; the prefactors 12 and 0.25 are not verified.
    `friction` is the tangent of the angle of repose.
    """
    mass = math.pi / 6 * diameter**3 * projectile_density
    return {
        "stiffness": 12 * friction * mass * gravity / diameter * math.sqrt(bulk_density / projectile_density),
        "drag": mass * friction * bulk_density / (0.25 * diameter * projectile_density),
    }


def _make_bekker(v: Mapping[str, float]) -> tuple[float, ...]:
    pressure = v["cohesive_modulus"] / v["radius"] + v["frictional_modulus"]
    return (math.pi * v["radius"] ** 2 * pressure, v["exponent"], v["tip_height"])


def _make_rft(v: Mapping[str, float]) -> tuple[float, ...]:
    gradient = stress_gradient(bulk_density=v["bulk_density"], friction=v["friction"], gravity=v["gravity"])
    g, wall = ball_profile(v["surface_friction"])
    ring = 2 * math.pi * v["radius"] ** 3 * gradient
    shape = [float(gk) / ((k + 1) * (k + 2)) for k, gk in enumerate(g)]
    slope = sum(float(gk) / (k + 1) for k, gk in enumerate(g))
    drag = 0.5 * math.pi * v["radius"] ** 2 * v["inertia"] * v["bulk_density"]
    return (ring, drag, v["radius"], *shape, slope, wall)


def _make_rft_foot(v: Mapping[str, float]) -> tuple[float, ...]:
    gradient = stress_gradient(bulk_density=v["bulk_density"], friction=v["friction"], gravity=v["gravity"])
    shape = {name: v[name] for name in ("area", "height", "roundness", "perimeter")}
    profile = foot_profile(**shape, surface_friction=v["surface_friction"])
    stiff, drag = v["area"] * profile.height * gradient, v["area"] * v["inertia"] * v["bulk_density"]
    lead = (stiff, drag, profile.height, profile.exponent)
    return (*lead, *profile.loading, profile.slope, profile.wall, *profile.inertia)


def _law(name: str, loading: str, rate: str, **others: Any) -> SurfaceLaw:
    """A law whose functions are those of `rigid.ground.law_functions` that begin with `loading` and with `rate`."""
    functions = {kind: getattr(fn, f"{loading}_{kind}") for kind in ("loading", "loading_work")}
    functions |= {kind: getattr(fn, f"{rate}_{kind}") for kind in ("rate_force", "rate_work")}
    return SurfaceLaw(name=name, has_memory=_REBOUND in others["parameters"], **functions, **others)


_number = partial(Parameter, lowest=0.0)  # a parameter that is never negative
_REBOUND = _number("rebound", "1", 0.05, "share of the deepest depth that springs back", lowest=1e-3, highest=0.5,
                   source=MEMORY)  # fmt: skip
_MEMORY = (
    _REBOUND,
    _number("loss", "1", 0.0, "share of the springback's work that a fast cycle of unloading and loading loses",
            highest=1.0, source=LOSS),
    _number("loss_speed", "m/s", 0.12, "speed of retreat at which half of that share is lost", lowest=1e-6,
            source=LOSS),
)  # fmt: skip
"""Of all laws that remember the deepest depth."""
_RADIUS = _number("radius", "m", 0.006, "radius of the spike's ball and shaft", highest=1.0, above_lowest=True,
                  source="ours : 12 mm across")  # fmt: skip
_SAND = katsuragi_durian(
    diameter=0.012, projectile_density=7850.0, bulk_density=1500.0, friction=0.6, gravity=EARTH_GRAVITY
)

_RFT = (
    _number("bulk_density", "kg/m3", 1500.0, "rho_c of the bed", highest=2e4, above_lowest=True,
            source="dry sand"),
    _number("friction", "1", 0.6, "internal friction coefficient of the grains", lowest=0.1, highest=0.9,
            source="dry sand; the fit of xi_n is for 0.3 to 0.9"),
    _number("surface_friction", "1", 0.4, "friction coefficient of grains and spike", highest=2.0,
            source="ours"),
    _number("gravity", "m/s2", EARTH_GRAVITY, "gravity of the grains: 1 g even in the rig", highest=100.0,
            above_lowest=True, source="docs/planar.md"),
    _number("inertia", "1", 1.1, "factor of rho v_n^2, the pressure of grains that are accelerated", highest=10.0,
            source="1.1 for plates dragged level, 1 for a wheel: Agarwal et al. (2021), see rft.py"),
)  # fmt: skip
"""Of the grains, of all laws of 3D-RFT."""

_LAWS = (
    _law(
        "spring-damper", "spring_damper", "spring_damper",
        summary="K z + C dz/dt while going in: the paper's surface",
        source="Reid et al., i-SAIRAS 2014, eqs 5 and 6",
        parameters=(
            _number("stiffness", "N/m", 1.5e4, "K", source="ours, as of brick"),
            _number("damping", "N s/m", 60.0, "C, going in only", source="ours, as of brick"),
        ),
        slots=("stiffness", "damping"), extensive=(0, 1),
    ),
    _law(
        "hunt-crossley", "power", "hunt_crossley",
        summary="K z^n (1 + 3/2 alpha dz/dt): restitution 1 - alpha v for small v, no jump of force at first touch",
        source="Hunt and Crossley, Journal of Applied Mechanics 42 (1975), 440",
        parameters=(
            _number("stiffness", "N/m^n", 2.1e5, "K", above_lowest=True,
                    source="ours: as stiff as the spring of brick at a depth of 5 mm"),
            _number("dissipation", "s/m", 0.2, "alpha: how restitution falls with the speed of impact", highest=10.0,
                    source="0.08 to 0.32 s/m for steel, bronze, ivory: Hunt and Crossley, quoted in Drake's manual"),
            _number("exponent", "1", 1.5, "n", lowest=1.0, highest=3.0, source="Hertz: 3/2 for a ball on a flat"),
        ),
        slots=("stiffness", "dissipation", "exponent"), extensive=(0,),
    ),
    _law(
        "power", "power", "spring_damper",
        summary="K z^n + C dz/dt while going in",
        source="the spring-damper with another exponent; n = 3/2 is Hertz, 2 a cone in a material of constant hardness",
        parameters=(
            _number("stiffness", "N/m^n", 2.1e5, "K", above_lowest=True,
                    source="ours: as stiff as the spring of brick at a depth of 5 mm"),
            _number("damping", "N s/m", 60.0, "C, going in only", source="ours, as of brick"),
            _number("exponent", "1", 1.5, "n", lowest=0.5, highest=4.0, source="Hertz"),
        ),
        slots=("stiffness", "damping", "exponent"), extensive=(0, 1),
    ),
    _law(
        "power-irreversible", "power", "spring_damper",
        summary="K z^n + C dz/dt while going in, and nearly nothing returned: a power law of grains",
        source="as power, with the unloading that grains have here",
        parameters=(
            _number("stiffness", "N/m^n", 1146.0, "K", above_lowest=True,
                    source="ours: 81 N/m times 5 mm at 5 mm, a 12 mm spike in sand (docs/results/penetrate-sand)"),
            _number("damping", "N s/m", 0.63, "C, going in only", source="as stiffness"),
            _number("exponent", "1", 1.5, "n", lowest=0.3, highest=4.0, source="as power"),
            *_MEMORY,
        ),
        slots=("stiffness", "damping", "exponent"), extensive=(0, 1),
        gravity_powers={"stiffness": 1.0, "damping": 0.5},
    ),
    _law(
        "katsuragi-durian", "spring_damper", "inertial",
        summary="k z + b (dz/dt)^2 while going in: a ball that falls into grains",
        source="Katsuragi and Durian, Nature Physics 3 (2007), 420 and Physical Review E 87, 052208 (2013)",
        parameters=(
            _number("stiffness", "N/m", _SAND["stiffness"], "k: friction that grows with depth", above_lowest=True,
                    source="`katsuragi_durian`: a 12 mm steel ball in sand of 1500 kg/m3 and friction 0.6 at 1 g"),
            _number("drag", "kg/m", _SAND["drag"], "b = m / d_1: inertia of the grains", source="as stiffness"),
            *_MEMORY,
        ),
        slots=("stiffness", "drag"), extensive=(0, 1), gravity_powers={"stiffness": 1.0},
    ),
    _law(
        "bekker", "bekker", "no",
        summary="A(z) (k_c / b + k_phi) z^n: pressure and sinkage of a plate, here of the spike's section",
        source="Bekker, Introduction to Terrain-Vehicle Systems (1969); it is for far larger plates",
        parameters=(
            _RADIUS,
            _number("tip_height", "m", 0.006,
                    "depth at which the section is full: the radius for a ball, 0 for a flat end", highest=1.0,
                    source="geometry"),
            _number("cohesive_modulus", "N/m^(n+1)", 990.0, "k_c",
                    source="dry sand: Wong, Theory of Ground Vehicles (2008), Table 2.3, at second hand"),
            _number("frictional_modulus", "N/m^(n+2)", 1.52843e6, "k_phi", above_lowest=True,
                    source="as cohesive_modulus"),
            _number("exponent", "1", 1.1, "n", lowest=0.1, highest=2.0, source="as cohesive_modulus"),
            *_MEMORY,
        ),
        slots=("pressure times section", "exponent", "tip_height"), extensive=(0,), bends=(2,), make=_make_bekker,
        of_one_g=("cohesive_modulus", "frictional_modulus"),
    ),
    _law(
        "rft", "rft", "rft",
        summary="3D-RFT over ball and shaft going straight down, with the inertia of the grains",
        source="Agarwal, Goldman and Kamrin, PNAS 120 (2023), e2214017120; see rigid/ground/rft.py",
        parameters=(
            _RADIUS,
            *_RFT,
            *_MEMORY,
        ),
        slots=("2 pi R^3 xi_n", "pi R^2 lambda rho / 2", "radius", *(f"shape {k}" for k in range(8)), "slope", "wall"),
        extensive=(0, 1), bends=(2,), make=_make_rft,
    ),
)  # fmt: skip

_FOOT_LAWS = (
    _law(
        "rft-foot", "rft_foot", "rft_foot",
        summary="3D-RFT over the underside of a foot going straight down, with the inertia of the grains",
        source="as rft; the surface integral of `rigid.ground.rft_foot`",
        parameters=(
            _number("area", "m2", math.pi * 0.006**2, "of the foot from above", above_lowest=True,
                    source="ours: 12 mm across"),
            _number("height", "m", 0.006, "depth at which the section is full; of no effect on a flat foot",
                    highest=10.0, source="geometry"),
            _number("roundness", "1", 0.0, "0: flat, 1: a cylinder that lies, 2: a ball or spheroid", highest=2.0,
                    source="geometry"),
            _number("perimeter", "m", 0.0, "of upright walls above the underside", source="geometry"),
            *_RFT,
            *_MEMORY,
        ),
        slots=("A h xi_n", "A lambda rho", "height", "exponent", *(f"shape {k}" for k in range(8)), "slope", "wall",
               *(f"inertia {k}" for k in range(4))),
        extensive=(0, 1), bends=(2,), make=_make_rft_foot,
    ),
)  # fmt: skip

GROUNDS: dict[str, SurfaceLaw] = {law.name: law for law in _LAWS}  # All laws by name; `hedgebed tumble --ground NAME`
FOOT_LAWS: dict[str, SurfaceLaw] = {law.name: law for law in _FOOT_LAWS}
"""Laws whose parameters are the shape of a foot: `rigid.ground.soles` makes them, a user does not choose them."""
