"""How a surface law follows the size of a foot: the parameters of one tip become those of another.

Dry rigid grains far smaller than the tip have one scale of length, its diameter D, and one of time, sqrt(D / g). So
F / (rho g D^3) is a function of z / D and of v / sqrt(g D) for tips of one shape. A term c z^n (dz/dt)^q of the force
therefore has c in proportion to g^(1 - q/2) D^(3 - n - q/2). So K z and b (dz/dt)^2 are proportional to the area,
C dz/dt to D^2.5, and 1 / alpha of Hunt and Crossley's rate to sqrt(g D). D is that of the circle of the foot's area.
Kang et al., Nature Communications 9 (2018), 1101, measure F in proportion to the displaced volume: for a flat foot to
A z. Roth, Han and Jaeger, arXiv 1910.10358, find that parts of the depth and of the rate do not add up: a limit of
every law here, whatever its size.

Two laws have a scale of their own. In Bekker's pressure (k_c / b + k_phi) z^n, b is the smaller side of a plate, or the
radius of a round one (Bekker 1969). It acts on the foot's area. 3D-RFT is integrated over the foot's underside
(`rigid.ground.rft_foot`).

None of this holds on hard ground, where the spike gives way and not the ground, nor with cohesion.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

from .laws import find_law
from .rft_foot import FLAT, ROUND

__all__ = ["SizedLaw", "Sole", "diameter_powers", "ill_sized", "of_one_foot", "shape_ratio", "sized_law"]


@dataclass(frozen=True, kw_only=True)
class Sole:
    """The size and shape of a foot that a surface law takes."""

    area: float  # From above [m2]
    width: float  # b of Bekker's plate: the smaller side, or the radius of a round foot [m]
    height: float = 0.0  # Depth at which the section is full [m]; 0 of a flat foot
    roundness: float = FLAT  # `rigid.ground.rft_foot`: flat, a lying cylinder, round
    perimeter: float = 0.0  # Of upright walls above the underside [m]

    @property
    def diameter(self) -> float:
        """Of the circle of the same area [m]."""
        return 2 * math.sqrt(self.area / math.pi)

    @classmethod
    def of_flat_tip(cls, diameter: float) -> "Sole":
        """A shaft of `diameter` [m] with a level end."""
        return cls(area=0.25 * math.pi * diameter**2, width=0.5 * diameter, perimeter=math.pi * diameter)

    @classmethod
    def of_spike(cls, diameter: float) -> "Sole":
        """A ball of `diameter` [m] with a shaft as wide."""
        radius = 0.5 * diameter
        return cls(
            area=math.pi * radius**2, width=radius, height=radius, roundness=ROUND, perimeter=2 * math.pi * radius
        )


@dataclass(frozen=True, kw_only=True)
class SizedLaw:
    """A surface law as one foot has it."""

    law: str
    parameters: Mapping[str, float]
    count: float = 1.0  # How many times these parameters it is [1]


def diameter_powers(law: str, values: Mapping[str, float]) -> dict[str, float]:
    """Name of a parameter -> power of the tip's diameter that it is in proportion to, in dry grains.

    Empty for bekker and rft, which have a scale of their own. ``values``: all parameters of the law. Raises ValueError
    for a law there is not.
    """
    exponent = values.get("exponent", 1.0)
    known = {
        "spring-damper": {"stiffness": 2.0, "damping": 2.5},
        "hunt-crossley": {"stiffness": 3 - exponent, "dissipation": -0.5},
        "power": {"stiffness": 3 - exponent, "damping": 2.5},
        "power-irreversible": {"stiffness": 3 - exponent, "damping": 2.5},
        "katsuragi-durian": {"stiffness": 2.0, "drag": 2.0},
        "bekker": {},
        "rft": {},
    }
    return known[find_law(law).name]


def of_one_foot(law: str) -> tuple[str, ...]:
    """Names of the parameters of a law that are of one foot or of one gravity: their defaults suit no other.

    Raises ValueError for a law there is not.
    """
    found = find_law(law)
    own = {"bekker": ("radius", "tip_height", *found.of_one_g), "rft": ("radius", "gravity"),
           "rft-foot": ("area", "height", "roundness", "perimeter", "gravity")}  # fmt: skip
    return own[found.name] if found.name in own else tuple(diameter_powers(found.name, {}))


def sized_law(
    law: str, parameters: Mapping[str, float], sole: Sole, *, of: float, given: Collection[str] = ()
) -> SizedLaw:
    """`law` of a tip of diameter `of` [m] as a foot with this `sole` has it.

    ``parameters``: of the tip. ``given``: names of those that are of this foot already and stay. With bekker and rft
    a given radius means that the foot is the law's own ball or plate. Raises ValueError for an unknown law or
    parameter. It also refuses a diameter, area, width, height or perimeter that is not a finite number in its range.
    """
    _refuse_sizes(sole, of)
    values = find_law(law).values(parameters)
    if law in ("bekker", "rft") and "radius" in given:
        return SizedLaw(law=law, parameters=values)
    if law == "bekker":
        height = {} if "tip_height" in given else {"tip_height": sole.height}
        plates = sole.area / (math.pi * sole.width**2)
        return SizedLaw(law=law, parameters=values | {"radius": sole.width} | height, count=plates)
    if law == "rft":
        kept = {name: value for name, value in values.items() if name != "radius"}
        shape = {name: getattr(sole, name) for name in ("area", "height", "roundness", "perimeter")}
        return SizedLaw(law="rft-foot", parameters=kept | shape)
    ratio = sole.diameter / of
    powers = {name: power for name, power in diameter_powers(law, values).items() if name not in given}
    return SizedLaw(law=law, parameters=values | {name: values[name] * ratio**power for name, power in powers.items()})


def shape_ratio(sole: Sole, tip: Sole, *, depth: float) -> float:
    """Force on `sole` over that on a sole of its area and of the shape of `tip`, by 3D-RFT going slowly down [1].

    ``tip``: the ball or flat end of a spike. ``depth``: of both, over the diameter of the circle of that area [1]. This
    is what similarity (`sized_law`) leaves out: it takes every foot for one of the tip's shape. Density, friction and
    gravity of the grains have no effect; surface friction is rft's default. Raises ValueError for a depth that is not
    above 0, and as `sized_law`.
    """
    if not (math.isfinite(depth) and depth > 0):
        raise ValueError(f"depth = {depth!r} must be above 0 (diameters) and finite")
    size = sole.diameter
    like = replace(
        tip, area=sole.area, width=0.5 * size, height=tip.height * size / tip.diameter,
        perimeter=tip.perimeter * size / tip.diameter,
    )  # fmt: skip
    own, other = (sized_law("rft", {}, each, of=size) for each in (sole, like))
    law = find_law(own.law)
    return float(law.force(depth * size, 0.0, law.numbers(own.parameters))) / float(
        law.force(depth * size, 0.0, law.numbers(other.parameters))
    )


def _refuse_sizes(sole: Sole, of: float) -> None:
    """Raise ValueError, naming it, for a size that is not finite, or not above 0 (height, perimeter: below 0)."""
    if not (math.isfinite(of) and of > 0):
        raise ValueError(
            f"of = {of!r} must be above 0 (m) and finite: the diameter of the tip that the parameters are of"
        )
    for name, unit in (("area", "m2"), ("width", "m")):
        value = getattr(sole, name)
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"sole: {name} = {value!r} must be above 0 ({unit}) and finite")
    for name in ("height", "perimeter"):
        value = getattr(sole, name)
        if not (math.isfinite(value) and value >= 0):
            raise ValueError(f"sole: {name} = {value!r} must be at least 0 (m) and finite")


def ill_sized(law: str, given: Collection[str]) -> list[str]:
    """Names of parameters left at defaults that follow no foot: those of hard ground, or of another exponent.

    The defaults of hunt-crossley and power are of brick under a spike. A stiffness or modulus in N/m^n belongs to its
    exponent n, so that a given exponent asks for it. ``given``: names of parameters of this foot.
    """
    found = find_law(law)
    if law in ("hunt-crossley", "power"):
        return [name for name in diameter_powers(law, found.values({})) if name not in given]
    if "exponent" not in given:
        return []
    return [p.name for p in found.parameters if "^n" in p.unit.replace("(n", "n") and p.name not in given]
