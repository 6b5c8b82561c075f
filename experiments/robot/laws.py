"""The surface law under a robot's feet: where its numbers come from, and how they follow the size of a foot."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NotRequired, TypedDict

from coupling.robot import Foot, law_under_feet
from coupling.robot.soles import TIP, FeetLaw
from experiments.groundmap.maps import read_map
from experiments.platform.settled import Number, open_stiffness
from experiments.platform.surfaces import Surface
from rigid.ground.flat_foot import DEPTHS, OVER_LAW
from rigid.ground.laws import SurfaceLaw, find_law
from rigid.ground.rft_foot import FLAT
from rigid.ground.soles import Sole, diameter_powers, ill_sized, shape_ratio
from rigid.ground_file import GroundFile
from rigid.platform.rig import STANDARD_GRAVITY

from . import say
from .gravity import NEAR, GravityRule
from .settings import RobotSettings

__all__ = [
    "SPIKE", "Largest", "UnderFeet", "fitted_words", "given_parameters", "law_notes", "law_of", "of_sand",
    "settle_other_law", "settle_spring", "spring_words",
]  # fmt: skip

SPIKES_PER_ROW = 2.0  # Surfaces have their K and C for a row of two spikes
HARD = ("hunt-crossley", "power")  # Laws that hard ground has too: their defaults are those of brick
SPIKE = TIP  # Diameter of the spike that the defaults of the other laws are of [m]
SHAPE_DEPTH = 0.2
"""Depth over the diameter of the foot at which its shape is compared with that of the tip [1]: that of a light foot."""
LIKE_TIP = 1.1
"""Ratio of forces above which, and below whose inverse, a foot has another shape than the tip [1]."""
DEEPEST = {"rft": 1.5}
"""Depth over the diameter of a foot down to which a law of grains was compared with them [1]: pushes of a ball of 12 mm
to 1 diameter (docs/results/calibrate-sand-1mm), drops of a ball to 1.7 (docs/results/katsuragi-durian)."""
SAME_AREA = 0.02
"""Relative difference of two areas from above that is not stated [1]: a polygon of 32 sides has 0.6 % less than its
circle."""
OWN_SCALE = {"bekker": ("radius", "tip_height"), "rft": ("radius",)}
"""Laws that take the foot's own size -> the parameters that it replaces."""


@dataclass(frozen=True, kw_only=True)
class Largest:
    """The part of the feet that has the largest area from above."""

    name: str
    times: float  # Its area over that of the tip that the law is of [1]
    sole: Sole

    @property
    def alike(self) -> bool:
        """Whether it has the area of the tip, up to the polygon that stands for a round foot."""
        return abs(self.times - 1.0) < SAME_AREA


class OneLaw(TypedDict):
    """Arguments of `LawFeet` where every part has the same law."""

    law: str
    parameters: Mapping[str, float]
    speeds: NotRequired[dict[str, float]]  # As of `FeetLaw`


@dataclass(frozen=True, kw_only=True)
class UnderFeet:
    """A law, and the tip that its parameters are of."""

    law: str
    parameters: Mapping[str, float]
    of: float | None  # Diameter of the tip [m]; None where they are not scaled to the size of a foot
    given: Collection[str] = ()  # Names of parameters that are of one foot already
    depth: float | None = None  # To which they hold under the tip [m]; None: not known
    rule: GravityRule | None = None  # Has K and C of each part where grains stick

    def options(self, feet: Sequence[Foot], matrices: Sequence[Any]) -> FeetLaw | OneLaw:
        """Arguments of `LawFeet` for `feet`, turned by `matrices`."""
        if self.of is None:
            return {"law": self.law, "parameters": self.parameters}
        found = law_under_feet(
            feet, matrices, self.law, self.parameters, of=self.of, given=self.given, depth=self.depth
        )  # fmt: skip
        if self.rule is not None:
            for part, parameters in found["under"].items():
                of_map = {name: value for name, value in self.rule.of_part(part).items() if name not in self.given}
                found["under"][part] = {**parameters, **of_map}
        return found


def law_of(
    settings: RobotSettings,
    surface: Surface,
    fitted: GroundFile | None,
    numbers: Mapping[str, Number],
    *,
    rule: GravityRule,
    as_spring: bool,
) -> UnderFeet:
    """The law of `settings`, or the spring-damper where `as_spring` or on grains.

    On hard ground K is that of the spike that gives way. The spring-damper, hunt-crossley and power are therefore not
    scaled to the size of a foot there. Laws of grains have no numbers for hard ground: they are refused there. With
    ``ignore_foot_size`` they run as under a spike. The law of a file is always scaled.
    """
    if fitted is not None and not as_spring:
        most = fitted.range["depth"][1]
        return UnderFeet(law=fitted.law, parameters=fitted.values, of=fitted.foot.diameter, depth=most)
    if as_spring or settings.on_grains or settings.ground == "spring-damper":
        own = {key: numbers[key].value for key in ("stiffness", "damping")}
        given = [key for key in own if getattr(settings, key) is not None]
        tip = surface.spike if surface.granular else None
        depth = None if tip is None or "stiffness" in given else _depth_of_map(surface, tip)
        return UnderFeet(law="spring-damper", parameters=own, of=tip, given=given, depth=depth, rule=rule)
    given_here = given_parameters(settings)
    found = find_law(settings.ground)
    parameters = found.values(found.in_gravity(numbers["gravity"].value, given_here))
    unsized = not surface.granular or bool(ill_sized(settings.ground, given_here))  # the second: accepted
    depth = DEEPEST[settings.ground] * SPIKE if settings.ground in DEEPEST and not unsized else None
    of = None if unsized else SPIKE
    return UnderFeet(law=settings.ground, parameters=parameters, of=of, given=tuple(given_here), depth=depth)


def _depth_of_map(surface: Surface, tip: float) -> float | None:
    """Depth to which K and C of `surface` hold under its spike [m], as its map has it; None without a map."""
    try:
        return read_map(surface.grains or "").deepest * tip
    except ValueError:
        return None


def settle_spring(
    settings: RobotSettings, surface: Surface, rule: GravityRule, largest: float, numbers: dict[str, Number]
) -> list[str]:
    """Settle K and C of one spike, and warn where they are those of another gravity than the run's.

    ``largest``: area of the largest foot over that of the spike [1].
    """
    powers = diameter_powers("spring-damper", {})
    for key, unit in (("stiffness", "N/m"), ("damping", "N s/m")):
        given, own = getattr(settings, key), rule.scale(key) * getattr(surface, key) / SPIKES_PER_ROW
        whose = f"a ball tip of {1e3 * surface.spike:g} mm" if surface.spike is not None else "a spike of the platform"
        times = rule.times(key, largest ** (0.5 * powers[key]))
        origin = f"surface {surface.name}{rule.origin(key)}, of {whose}{_times(times, 2.0)}"
        numbers[key] = Number(own, unit, origin) if given is None else Number(given, unit, "given")
    if settings.stiffness is not None or not surface.granular:
        return []
    return rule.warning(surface, largest * numbers["stiffness"].value)


def settle_other_law(
    settings: RobotSettings, surface: Surface, gravity: float, largest: Largest, numbers: dict[str, Number]
) -> list[str]:
    """Settle the parameters of a law other than the spring-damper, and warn of those that are the law's defaults.

    The spike that the defaults are of is the tip of ``largest``. Raises ValueError for a
    parameter there is not, or out of bounds. Unless they are accepted, three more raise it: a law that no foot on
    grains has; a law of grains on hard ground; and defaults of 1 g that follow no other gravity.
    """
    law, given = find_law(settings.ground), given_parameters(settings)
    ill = ill_sized(law.name, given)
    law.values(given)  # refuses a name or value that cannot be, before what it would do
    _refuse_unsized(settings, surface, law, ill)
    if not gravity > 0 and "gravity" not in given and any(p.name == "gravity" for p in law.parameters):
        raise ValueError(say("weightless", law=law, gravity=numbers["gravity"]))
    values = law.values(law.in_gravity(gravity, given))
    unsized = bool(ill) or not surface.granular
    powers = {} if unsized else diameter_powers(law.name, values)
    replaced = () if unsized or "radius" in given else OWN_SCALE.get(law.name, ())
    for parameter in law.parameters:
        name = parameter.name
        whose = "dry sand" if law.name in OWN_SCALE and not unsized else f"a tip of {1e3 * SPIKE:g} mm"
        sized = _times(largest.times, powers.get(name, 0.0))
        origin = f"default of {law.name}, of {whose}{_in_gravity(law, name)}{sized}"
        origin = "given" if name in given else origin
        if name not in ("gravity", *replaced) or (name in given and name != "gravity"):
            numbers[name] = Number(values[name], parameter.unit, origin)
        elif name == "gravity" and name in given:
            numbers["ground_gravity"] = Number(values[name], parameter.unit, origin)
    left = [name for name in values if name not in given and name not in ("gravity", *replaced)]
    if not left:
        return []
    if unsized:
        size = say("size_unsized", area=_area(largest), spike=1e3 * SPIKE)
    elif law.name in OWN_SCALE:
        size = say(f"size_{law.name}")
    elif any(name in powers for name in left):
        size = _similar(largest, Sole.of_spike(SPIKE), say("tip_sphere"), SPIKE, "dry sand")
    else:
        size = say("size_none")
    follows = "gravity" in values or bool(law.gravity_powers)
    more = "" if follows else ", nor gravity"
    told = [say("law_defaults", names=", ".join(left), law=law, surface=surface, more=more, size=size)]
    if of_sand(settings, surface):
        told = []  # `law_notes` has it
    fixed = surface.granular and not follows and not NEAR[0] <= gravity / STANDARD_GRAVITY <= NEAR[1]
    of_law = [say("gravity_of_law", law=law.name, gravity=gravity)] if fixed else []
    return [*told, *of_law, *_flat_in_grains("" if given or unsized else law.name, surface, largest)]


def of_sand(settings: RobotSettings, surface: Surface) -> bool:
    """Whether the law is 3D-RFT, whose defaults are those of dry sand, on sand."""
    return settings.ground == "rft" and surface.name == "sand"


def law_notes(settings: RobotSettings, surface: Surface) -> list[str]:
    """Which law a robot on sand stands on, in a sentence; none of another law."""
    if not of_sand(settings, surface):
        return []
    return [say("chosen_law", share=find_law("rft").rebound(given_parameters(settings)))]


def _flat_in_grains(law: str, surface: Surface, largest: Largest) -> list[str]:
    """How much harder grains push a flat foot than this law of sand, in a sentence; none where it was not measured."""
    if surface.name != "sand" or largest.sole.roundness != FLAT or law not in OVER_LAW:
        return []
    (shallow, deep), (first, last) = DEPTHS, OVER_LAW[law]
    return [say("flat_in_grains", name=largest.name, law=law, shallow=shallow, deep=deep, first=first, last=last)]


def spring_words(settings: RobotSettings, surface: Surface, largest: Largest, rule: GravityRule) -> list[str]:
    """For which foot K and C of `surface` are, how far the largest is from it, and their errors; none if given."""
    left = [key for key in ("stiffness", "damping") if getattr(settings, key) is None]
    if not left:
        return []
    if surface.spike is None:
        size = say("size_hard", most=largest)
    elif rule.feet:
        size = say("size_of_map", shape=_unlike(largest, Sole.of_spike(surface.spike)))
    else:
        size = _similar(largest, Sole.of_spike(surface.spike), say("tip_sphere"), surface.spike, surface.name)
    told = [say("spring_defaults", names=" and ".join(left), surface=surface, size=size), *rule.errors(surface, left)]
    if "stiffness" in left and not rule.feet:
        told += open_stiffness(surface)
    if surface.granular:
        told.append(say("springs_back", share=find_law("rft").rebound({})))
    return [*told, *_flat_in_grains("spring-damper" if len(left) == 2 else "", surface, largest)]


def fitted_words(fitted: GroundFile, largest: Largest) -> list[str]:
    """The same of the law of a file; none where the feet have size and shape of its tip."""
    tip, diameter = fitted.foot.tip, fitted.foot.diameter
    if fitted.law in OWN_SCALE:
        size = say(
            "size_file", kind=say(f"tip_{tip}"), spike=1e3 * diameter, grains=fitted.material, area=_area(largest)
        )
        return [say("fitted", file=fitted, size=size)]
    soles = {"sphere": Sole.of_spike, "flat": Sole.of_flat_tip}  # 3D-RFT has no series of a cone here
    sole = soles[tip](diameter) if tip in soles else None
    if largest.alike and not _unlike(largest, sole):
        return []
    return [say("fitted", file=fitted, size=_similar(largest, sole, say(f"tip_{tip}"), diameter, fitted.material))]


def _similar(largest: Largest, tip: Sole | None, kind: str, diameter: float, grains: str) -> str:
    """The size and shape of the largest foot over those of a tip, in words; ``tip``: None where it has no sole."""
    shape = _unlike(largest, tip)
    return say("size_similar", kind=kind, spike=1e3 * diameter, grains=grains, area=_area(largest), shape=shape)


def _unlike(largest: Largest, tip: Sole | None) -> str:
    """How the shape of the largest foot differs from that of a tip, in words; empty where it does not."""
    ratio = 1.0 if tip is None else shape_ratio(largest.sole, tip, depth=SHAPE_DEPTH)
    if 1 / LIKE_TIP <= ratio <= LIKE_TIP:
        return ""
    return say(f"shape_{'stiffer' if ratio > 1 else 'softer'}", name=largest.name, ratio=ratio, depth=SHAPE_DEPTH)


def _area(largest: Largest) -> str:
    """The area of the largest foot over that of the tip, in words; empty where they are the same."""
    return "" if largest.alike else say("largest_area", most=largest)


def _refuse_unsized(settings: RobotSettings, surface: Surface, law: SurfaceLaw, ill: list[str]) -> None:
    """Raise ValueError for parameters that belong to the other kind of ground or to another exponent."""
    if settings.ignore_foot_size:
        return
    if not surface.granular and law.name not in HARD:
        raise ValueError(say("grains_on_hard", law=law, surface=surface))
    if not ill or not surface.granular:
        return
    key = "unsized_law" if law.name in HARD else "unsized_exponent"
    needed = " ".join(f"{name}=VALUE" for name in ill)
    raise ValueError(say(key, law=law, names=" and ".join(ill), surface=surface, needed=needed, spike=1e3 * SPIKE))


def _in_gravity(law: SurfaceLaw, name: str) -> str:
    """How a default follows gravity, in words; empty where it does not."""
    power = law.gravity_powers.get(name)
    return f" times (g / {STANDARD_GRAVITY:g} m/s2)^{power:g}" if power else ""


def _times(largest: float, power: float) -> str:
    """How many times a number of one spike is under the largest foot, in words; ``power``: of the diameter."""
    return f"; {largest ** (0.5 * power):.3g} times under a foot" if power and largest > 1 + SAME_AREA else ""


def given_parameters(settings: RobotSettings) -> dict[str, float]:
    """The ground_parameters. Raises ValueError for one that is no name=value."""
    return dict(_assignment(text) for text in settings.ground_parameters)


def _assignment(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise ValueError(say("no_number", text=text)) from None
