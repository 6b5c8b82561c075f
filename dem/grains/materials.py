"""Grain materials: the numbers of single grains, each with where it comes from; and those of what grains meet.

A material has a name, of those that ship, or a file, as ``hedgebed bed calibrate`` writes it (TOML):
```
format = "hedgebed-material/1"
name = "my-sand"
density = 2650.0            # [kg/m3]
young = 70e9                # [Pa]
poisson = 0.25
friction = 0.5
restitution = 0.5
rolling_friction = 0.2      # 0 if not given
cohesion = "dmt"            # "none" if not given
surface_energy = 0.3        # [J/m2]; with cohesion
grain = 0.004               # the mean diameter for which surface_energy holds [m]; for every one if not given
tangential = "displacement" # the springs of friction and rolling; "rescaled" if not given
real_grain = 0.0003         # mean diameter of the real grains [m]: no number of a simulated grain (``real_grain_of``)
[sources]                   # where each number comes from, in words
friction = "..."
```
A table ``[calibration]`` may follow, which says how the numbers were found and is not read here.
"""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from dataclasses import MISSING, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from hedgebed_renamed import BEFORE_RUN_2, material_of_today

__all__ = [
    "MATERIALS",
    "MATERIAL_FORMAT",
    "Material",
    "SAND",
    "SAND_WEAK",
    "caveat",
    "material",
    "of_before",
    "read_material",
    "real_grain_of",
]

MATERIAL_FORMAT = "hedgebed-material/1"
_NAME = re.compile(r"[a-z0-9][a-z0-9._+-]*")

COHESIONS = ("none", "dmt", "jkr")  # The laws of cohesion, see ``dem.contact.cohesion``
TANGENTIAL = ("rescaled", "displacement")  # The springs of friction and rolling, see ``dem.contact.law``
LEAST_RESTITUTION = 0.01
LEAST_ROLLING = 1e-9
"""A rolling friction that resists nothing [1]: with none at all rolling is left out of a bed, on its bodies as well."""


@dataclass(frozen=True)
class Material:
    """What a grain is made of, and how two grains of it touch. SI units; ratios are dimensionless.

    Attributes:
        friction, restitution, rolling_friction: of two grains on one another.
        cohesion: "none", "dmt" or "jkr" (``dem.contact.cohesion``).
        surface_energy: gamma [J/m2], half the work of adhesion of two grains; 0 without cohesion.
        grain: mean diameter of the grains for which ``surface_energy`` holds [m], see ``for_grain``; None: of all.
        tangential: the springs of friction and rolling, "rescaled" or "displacement" (``dem.contact.law``).

    Raises ValueError: a number that no material can have, with the key and what is allowed.
    """

    name: str
    density: float
    young: float
    poisson: float
    friction: float
    restitution: float
    rolling_friction: float = 0.0
    cohesion: str = "none"
    surface_energy: float = 0.0
    grain: float | None = field(default=None, compare=False)
    tangential: str = "rescaled"
    sources: dict[str, str] = field(default_factory=dict, compare=False)

    def __post_init__(self):
        def refuse(key, bounds):
            raise ValueError(f"material {self.name!r}: {key} = {getattr(self, key)} must be {bounds}")

        for key in ("density", "young"):
            if not 0 < getattr(self, key) < math.inf:
                refuse(key, "finite" if math.isinf(getattr(self, key)) else "positive")
        if not 0 <= self.poisson < 0.5:
            refuse("poisson", "at least 0 and below 0.5")
        if not LEAST_RESTITUTION <= self.restitution <= 1:
            refuse("restitution", f"between {LEAST_RESTITUTION} and 1")
        for key in ("friction", "rolling_friction"):
            if not 0 <= getattr(self, key) < math.inf:
                refuse(key, "0 or more")
        for key, value, laws in (("cohesion", self.cohesion, COHESIONS), ("tangential", self.tangential, TANGENTIAL)):
            if value not in laws:
                near = difflib.get_close_matches(str(value).lower(), laws, n=1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                raise ValueError(
                    f"material {self.name!r}: {key} = {value!r} is no law; there is {', '.join(laws)}{hint}"
                )
        if self.cohesion == "none":
            if self.surface_energy != 0:
                refuse("surface_energy", "0 without a law of cohesion; set cohesion to 'dmt' or 'jkr' [J/m2]")
        elif not 0 < self.surface_energy < math.inf:
            refuse("surface_energy", f"positive with cohesion {self.cohesion!r} [J/m2]")
        if self.grain is not None and not 0 < self.grain < math.inf:
            refuse("grain", "positive [m]")

    def softened(self, young: float) -> Material:
        """The same material with another Young's modulus [Pa]."""
        return replace(self, young=young)

    def with_rolling(self) -> Material:
        """The same material, so that bodies of its bed can have a rolling friction where its grains have none."""
        return replace(self, rolling_friction=max(self.rolling_friction, LEAST_ROLLING))

    def for_grain(self, diameter: float) -> Material:
        """The same material in grains of another mean diameter [m], with the strength that it has in its own.

        Cohesion, a stress, is proportional to surface energy over diameter, so the surface energy changes with the
        diameter. A material that does not state the grains of its surface energy stays unchanged.
        """
        if self.grain is None or self.cohesion == "none":
            return self
        return replace(self, surface_energy=self.surface_energy * diameter / self.grain, grain=diameter)


@dataclass(frozen=True)
class Facing:
    """How a grain touches something else than a grain: the floor, a wall, a body. None: as two grains touch.

    Attributes:
        friction, restitution, rolling_friction: of a grain on it [1].
        young: of what it is made of [Pa]; rigid when None. poisson: [1].
        surface_energy: of the pair [J/m2], half its work of adhesion; 0 for what grains do not stick to.

    Raises ValueError: a number that no pair can have, with the key and what is allowed.
    """

    friction: float | None = None
    restitution: float | None = None
    rolling_friction: float | None = None
    young: float | None = None
    poisson: float = 0.3
    surface_energy: float | None = None

    def __post_init__(self):
        def refuse(key, bounds):
            raise ValueError(f"{key} = {getattr(self, key)} must {bounds}")

        for key in ("friction", "rolling_friction", "surface_energy"):
            value = getattr(self, key)
            if value is not None and not 0 <= value < math.inf:
                refuse(key, "be 0 or more")
        if self.restitution is not None and not LEAST_RESTITUTION <= self.restitution <= 1:
            refuse("restitution", f"lie between {LEAST_RESTITUTION} and 1")
        if self.young is not None and not self.young > 0:
            refuse("young", "be positive [Pa], or None for what is rigid")
        if not 0 <= self.poisson < 0.5:
            refuse("poisson", "be at least 0 and below 0.5")

    def refuse_for(self, material: Material) -> None:
        """Raise ValueError for a surface energy where the material has no law of cohesion, and likewise for rolling."""
        if self.rolling_friction and not material.rolling_friction:
            raise ValueError(
                f"rolling_friction = {self.rolling_friction} needs rolling, which a bed of {material.name!r} leaves "
                f"out, as its grains have no rolling friction; give the grains {LEAST_ROLLING:g}"
            )
        if self.surface_energy and material.cohesion == "none":
            raise ValueError(
                f"surface_energy = {self.surface_energy} J/m2 needs a law: the material {material.name!r} has cohesion "
                f"'none'; give it 'dmt' or 'jkr'"
            )


PRESETS = Path(__file__).parents[1] / "presets"


def read_material(path: str | Path) -> Material:
    """The material in a file of the form that this module's docstring gives.

    Raises ValueError: a file that cannot be read or has another form; an unknown or missing key; a value of the wrong
    kind or out of range. The name of a material that ships is refused too, where the numbers differ.
    """
    return _read_with_real_grain(Path(path))[0]


def _read_with_real_grain(path: Path) -> tuple[Material, float | None]:
    """The material in a file, as `read_material`, and its key ``real_grain`` [m]; None where it has none."""
    stuff, real = _read(path)
    known = MATERIALS.get(stuff.name)
    if known is not None and (known != stuff or known.grain != stuff.grain):
        raise ValueError(
            f"{path}: name = {stuff.name!r} is that of a material that ships, with other numbers; give another name"
        )
    return stuff, real


def _read(path: Path) -> tuple[Material, float | None]:
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"material = {str(path)!r} cannot be read: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"material = {str(path)!r} is not TOML: {error}") from None
    found = table.pop("format", None)
    if found != MATERIAL_FORMAT:
        raise ValueError(f"{path}: format = {found!r}, {MATERIAL_FORMAT!r} was expected")
    table.pop("calibration", None)
    real = _real_grain(path, table.pop("real_grain", None))
    known = {one.name: one for one in fields(Material)}
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"there is {', '.join(known)}"
            raise ValueError(f"{path}: {key} = {table[key]!r} is no key of a material; {hint}")
    needed = [key for key, one in known.items() if one.default is MISSING and one.default_factory is MISSING]
    if missing := [key for key in needed if key not in table]:
        raise ValueError(f"{path}: {', '.join(missing)} must be given")
    return Material(**{key: _of_its_kind(path, key, value) for key, value in table.items()}), real


def real_grain_of(name: str | Path) -> float | None:
    """Mean diameter of the real grains of a material [m], where it is known: of one that ships, or as its file states.

    Raises ValueError as `read_material`.
    """
    if (known := material_of_today(str(name).lower())) in MATERIALS:
        return REAL_GRAINS.get(known)
    return _read_with_real_grain(Path(name))[1]


def _real_grain(path: Path, value: Any) -> float | None:
    """A diameter [m], or None where none is given. Raises ValueError for what is none."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < 1:
        raise ValueError(f"{path}: real_grain = {value!r} must be a diameter in m, above 0 and below 1")
    return float(value)


def _of_its_kind(path: Path, key: str, value: Any) -> Any:
    """The value of a key of a file, a number as a float. Raises ValueError where it is of another kind."""
    texts, numbers = (str, "a text"), (int | float, "a number")
    known = (dict, "a table of texts, one for each number")
    kinds = {"name": texts, "cohesion": texts, "tangential": texts, "sources": known}
    kind, wanted = kinds.get(key, numbers)
    fits = isinstance(value, kind) and not isinstance(value, bool)
    if not fits or (kind is dict and not all(isinstance(text, str) for text in value.values())):
        raise ValueError(f"{path}: {key} = {value!r} must be {wanted}")
    if key == "name" and not _NAME.fullmatch(value):
        allowed = "small letters, digits, '.', '_', '+', '-'"
        raise ValueError(f"{path}: name = {value!r} cannot name a material: {allowed}")
    return value if key in kinds else float(value)


MATERIALS = {stuff.name: stuff for stuff, _ in map(_read, sorted(PRESETS.glob("*.toml")))}
"""The materials that ship, those of dem/presets (docs/materials.md)."""

REAL_GRAINS = {"sand": 2e-4, "sand-weak": 2e-4}
"""Diameter of real grains [m]: 0.2 mm is where fine sand ends and medium sand begins (ISO 14688-1)."""

SAND, SAND_WEAK = MATERIALS["sand"], MATERIALS["sand-weak"]
"""Fine silica sand, calibrated to its friction angle; and ``sand`` of before 2026-11-26, six degrees weaker."""

CAVEATS = {
    "sand-weak": "its rolling friction is a guess: 24 to 25 degrees of triaxial friction, where fine sand has 30 to "
    "33; 'sand' has 30, and a spike meets twice the force in it",
    "jsc-1a-loose": "calibrated to a cohesion that is JSC-1A's at most: faces of it stand seven times as high as "
    "JSC-1A's; 'jsc-1a-loose-cut' is the one to take",
    "jsc-1a-dense": "calibrated to a cohesion that is JSC-1A's at most: faces of it stand ten times as high as "
    "JSC-1A's; 'jsc-1a-dense-cut' is the one to take",
    "jsc-1a-loose-heights": "faces of it stand 2.7 times as high as JSC-1A's; those of 'jsc-1a-loose-cut' do not",
    "jsc-1a-dense-heights": "faces of it stand 2.4 times as high as JSC-1A's, those of 'jsc-1a-dense-cut' do not; and "
    "it peaks at 52 degrees in ring shear, where the vibrated powder, which is denser, has 60",
    "jsc-1a-dense-cut": "it peaks at 51 degrees in ring shear, where the vibrated powder, which is denser, has 60",
}
"""What a user of a material that ships has to know of it, by name: where its bulk figures are not the real one's."""


def material(name: str | Path | Material, *, grain: float | None = None) -> Material:
    """The material of that name or in that file, or the material itself.

    Args:
        name: of a material that ships, or the path of a file: what ends in .toml or has a slash in it. An earlier name
            of one that ships is taken too, with a FutureWarning.
        grain: mean diameter of its grains [m], see ``Material.for_grain``.

    Raises ValueError: no material has that name (the message lists the names); the file is wrong (``read_material``).
    """
    word = str(name)
    if isinstance(name, Material):
        stuff = name
    elif (known := material_of_today(word.lower())) in MATERIALS:
        stuff = MATERIALS[known]
    elif isinstance(name, Path) or word.endswith(".toml") or "/" in word:
        stuff = read_material(name)
    else:
        near = _begins_so(word.lower()) or difflib.get_close_matches(word.lower(), MATERIALS, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        there = ", ".join(sorted(MATERIALS))
        raise ValueError(f"material = {name!r} is not known; there is {there}, and files that end in .toml{hint}")
    return stuff if grain is None else stuff.for_grain(grain)


def _begins_so(word: str) -> list[str]:
    """Materials that begin with the word, hyphens aside, as jsc1a; those without a caveat first, the loose first."""
    short = word.replace("-", "")
    found = [name for name in MATERIALS if short and name.replace("-", "").startswith(short)]
    return sorted(found, key=lambda name: (name in CAVEATS, "dense" in name))


def of_before(stuff: Material) -> Material:
    """A material that a file of before 2026-11-26 may hold, by today's name where its numbers are those of that one."""
    today = MATERIALS.get(BEFORE_RUN_2.get(stuff.name, ""))
    return replace(stuff, name=today.name) if today and today.rolling_friction == stuff.rolling_friction else stuff


def caveat(stuff: Material) -> str | None:
    """A sentence for the warnings of a run: what ``CAVEATS`` has on the material; None where there is nothing."""
    known = CAVEATS.get(stuff.name)
    return known and f"the grains are {stuff.name!r}: {known} (docs/materials.md)"
