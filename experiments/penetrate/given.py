"""The settings of `penetrate` that gravity decides, and those that a file does: of a bed, or without one of a model."""

import math
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic.fields import FieldInfo

from experiments.campaign import PenetrationModel, read_model
from experiments.runs.types import Json
from experiments.runs.units import find_unit
from rigid.ground_file import read_ground

from .following import following, pace, sticking_of

__all__ = [
    "drops_nothing",
    "further_speeds",
    "material_of_bed",
    "settings_of_bed",
    "settings_of_gravity",
    "settings_of_ground",
    "settings_of_model",
]


def drops_nothing(settings: Any) -> bool:
    """Whether nothing is dropped on the further beds of settings: no speeds, or a load that only sinks to the floor.

    A material that cannot be read is refused later.
    """
    from dem.grains.materials import material
    from experiments.grains.bearing import bearing_of, sinks_past

    if not settings.other_drop_speeds:
        return True
    grain, area = settings.grain, math.pi * settings.tip_diameter**2 / 4
    try:
        stuff = material(settings.material, grain=grain)
        bears = bearing_of(stuff, grain=grain, gravity=settings.gravity, area=area)
        return sinks_past(bears, settings.weight, (settings.foot, settings.bed_size[2] - settings.tip_diameter))
    except (OSError, ValueError, OverflowError):
        return False


def further_speeds(speeds: tuple[float, ...]) -> tuple[float, ...]:
    """Speeds of pushes into further beds where nothing is dropped on them: the slowest and the fastest of the first's.

    One speed does not separate K from C.
    """
    return (min(speeds), max(speeds)) if len(speeds) > 1 else speeds


def settings_of_bed(given: Json) -> Json:
    """`given` with material, size, grains, gravity, seed and softness of its ``bed``.

    Raises ValueError for no bed, one that is tilted or cut, an unknown material, and where `given` contradicts it.
    """
    from dem.engine.state import read_file
    from dem.prepare.bedfile import find_bed, read_preparation

    name = str(given["bed"])
    path = find_bed(name)
    settings, state, precision = read_file(path)
    preparation = read_preparation(path)
    stages = [report.stage for report in preparation.reports]
    if settings.gravity[0] or settings.gravity[1] or any(s.startswith("cut") for s in stages):
        raise ValueError(f"bed = {name!r} was cut or tilted: a spike needs a level one, prepared without these stages")
    stuff = settings.material
    radii = state["position"][:, 3].astype(float)
    grain = _plain(2 * radii.mean())
    own = material_of_bed(name, stuff, given.get("material"))
    said = {
        "material": own,
        "bed_size": settings.size,
        "grain": grain,
        "spread": min(0.5, _plain((radii.max() - radii.min()) / (radii.max() + radii.min()))),
        "packing": None,
        "gravity": -settings.gravity[2],
        "seeds": (settings.seed if settings.seed is not None else 1,),
        "young": stuff.young,
        "max_overlap": settings.max_overlap,
        "time_step": settings.time_step,
        "precision": precision,
    }
    for key, value in said.items():
        if key != "material" and key in given and not _same(given[key], value):
            both = f"{key} = {given[key]!r} beside bed = {name!r}"
            raise ValueError(f"{both}, whose own is {value!r}: leave {key} out, or the bed")
    return given | said


def material_of_bed(bed: str, stuff: Any, asked: str | None) -> str:
    """Name or file of the material of a bed, whose grains are of ``stuff``.

    It is the one asked for, else one that ships, else the copy in the folder of the run that made the bed.
    A bed sets its material: one that is asked for must be the same. Raises ValueError where it is not, for one that
    cannot be read, and where none is found.
    """
    from dem.grains.materials import MATERIALS, material
    from dem.prepare.bedfile import find_bed, read_preparation

    path = find_bed(bed)
    kept = read_preparation(path).recipe.get("material", {}).get("grain")  # the size for which the bed was prepared
    copy = path.parent / "material.toml"
    names = [asked] if asked is not None else [stuff.name] if stuff.name in MATERIALS else []
    names += [str(copy)] if asked is None and copy.is_file() else []
    for name in names:
        known = material(name) if kept is None else material(name).for_grain(kept)
        if known.softened(stuff.young) == stuff:
            return name
    if asked is not None:
        other = f"material = {asked!r}: leave material out, or use the file that the bed was made with"
    else:
        other = f"one that ships ({', '.join(sorted(MATERIALS))}): give --material with the file that it was made with"
    raise ValueError(f"bed = {bed!r} is of a material {stuff.name!r} whose numbers are not those of {other}")


def settings_of_gravity(given: Json, fields: Mapping[str, FieldInfo]) -> Json:
    """`given` with the speeds, times and rig that follow its ``gravity``, where it has none; ``fields``: of the class.

    What is not accepted is refused later.
    """
    defaults = {name: field.default for name, field in fields.items()}
    numbers = {}
    for name in ("gravity", "grain", "tip_diameter"):
        value, unit = given.get(name, defaults[name]), find_unit(fields[name].description)
        try:
            value = unit.value_of(value) if isinstance(value, str) and unit is not None else float(value)
        except (TypeError, ValueError):
            return given
        if not 0 < value < math.inf:
            return given
        numbers[name] = value
    try:
        stuff = str(given.get("material", defaults["material"]))
        sticking = sticking_of(stuff, grain=numbers["grain"], diameter=numbers["tip_diameter"])
    except ValueError:
        return given
    return following(pace(numbers["gravity"], sticking=sticking), defaults) | given


def settings_of_model(given: Json) -> Json:
    """`given` with the spike of its ``model`` where it gives none: tip, diameter, cone angle and mass. The load is m g
    of the model's drops, where they all had one gravity and no mass is given. Runs that nobody asked for are left out.

    A file that cannot be read, or is no model of penetration, is refused later.
    """
    try:
        model = read_model(Path(str(given["model"])))
    except (OSError, ValueError):
        return given
    if not isinstance(model, PenetrationModel):
        return given
    spike = model.spike
    diameters = sorted({trial.diameter for trial in model.trial if trial.diameter is not None})
    own: Json = {"tip": spike.tip, "cone_angle": spike.cone_angle}
    own["tip_diameter"] = spike.diameter or (diameters[len(diameters) // 2] if diameters else None)
    if spike.mass is not None and given.get("mass") is None:
        own["mass"] = spike.mass
        gravities = [trial.gravity for trial in model.trial if trial.mode == "drop"]
        if gravities and math.isclose(min(gravities), max(gravities), rel_tol=1e-6):
            own["load"] = spike.mass * gravities[0]
    return {name: value for name, value in own.items() if value is not None} | _asked(given, model) | given


def _asked(given: Json, model: PenetrationModel) -> Json:
    """Settings without runs that nobody asked for: no drops where pushes are given or the model has none; pushes at the
    slowest, the middle and the fastest speed of the model's own where none are given; and a withdrawal at the fastest.
    """
    found: Json = {}
    pushes, drops = given.get("speeds"), [trial for trial in model.trial if trial.mode == "drop"]
    own = sorted({trial.speed for trial in model.trial if trial.mode == "driven" and trial.speed})
    if pushes is None and own:
        pushes = tuple(dict.fromkeys((own[0], own[len(own) // 2], own[-1])))
        found["speeds"] = pushes
    if "drop_speeds" not in given and (pushes or not drops):
        found |= {"drop_speeds": (), "other_drop_speeds": ()}
    with suppress(TypeError, ValueError):  # what is not accepted is refused later
        several = pushes if isinstance(pushes, list | tuple) else [pushes]
        if several and "retreat_speed" not in given:
            found["retreat_speed"] = max(several, key=_speed)
    return found


def _speed(value: Any) -> float:
    """A speed [m/s], a number or a text with a unit; raises ValueError or TypeError for what is none."""
    unit = find_unit("Speeds [m/s].")
    return unit.value_of(value) if isinstance(value, str) and unit is not None else float(value)


def settings_of_ground(given: Json) -> Json:
    """`given` with the tip of its ground file where it gives none, and the gravity where the file has only one.

    A file that cannot be read is refused later.
    """
    try:
        fitted = read_ground(str(given["ground"]))
    except ValueError:
        return given
    foot = fitted.foot
    own: Json = {"tip": foot.tip, "cone_angle": foot.cone_angle, "tip_diameter": foot.diameter}
    low, high = fitted.range["gravity"]
    return own | ({"gravity": high} if low == high else {}) | given


def _plain(value: float) -> float:
    """To six digits: a mean of many."""
    return float(f"{float(value):.6g}")


def _same(a: Any, b: Any) -> bool:
    if isinstance(b, tuple):
        return isinstance(a, list | tuple) and len(a) == len(b) and all(map(_same, a, b))
    if isinstance(b, float) and isinstance(a, int | float) and not isinstance(a, bool):
        return math.isclose(a, b, rel_tol=1e-9)
    return bool(a == b)
