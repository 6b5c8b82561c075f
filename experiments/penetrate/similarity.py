"""How similar the motions of a run are to those on Earth: Froude and inertial numbers, and what inertia adds."""

from collections.abc import Iterator

from experiments.grains.similarity import FAR, froude, inertia_share, inertial_number, quasi_static_speed
from experiments.runs.types import Json
from rigid.platform.rig import STANDARD_GRAVITY

from .following import SPEEDS, TIMES, following, pace, sticking_of
from .given import further_speeds
from .settings import PenetrateSettings, say

__all__ = ["fast_for_gravity", "pace_of", "similarity_of"]


def pace_of(settings: PenetrateSettings) -> float:
    """`pace` of these runs."""
    return pace(settings.gravity, sticking=_sticking(settings))


def _sticking(settings: PenetrateSettings) -> float:
    return sticking_of(settings.material, grain=settings.grain, diameter=settings.tip_diameter)


def similarity_of(settings: PenetrateSettings) -> Json:
    """The entry "similarity" of result.json: Froude and inertial numbers, which settings follow gravity, a sentence."""
    own = {name: type(settings).model_fields[name].default for name in (*SPEEDS, *TIMES)}
    slower, sticking = pace_of(settings), _sticking(settings)
    wanted = own | following(slower, own)
    if not settings.used("other_drop_speeds") or settings.other_speeds == further_speeds(settings.speeds):
        wanted["other_speeds"] = further_speeds(wanted["speeds"])
    used = [name for name in (*SPEEDS, *TIMES) if settings.used(name) not in ((), None)]
    given = [name for name in used if getattr(settings, name) != wanted[name]]
    speeds, of = sorted(settings.driven_speeds), {"diameter": settings.tip_diameter}
    numbers = [froude(speed, gravity=settings.gravity, **of) for speed in speeds]
    held = of | {"gravity": settings.gravity + sticking, "grain": settings.grain}
    inertial = [inertial_number(speed, **held) for speed in speeds]
    told = {
        "s": settings,
        "g": settings.gravity / STANDARD_GRAVITY,
        "held": ", their cohesion counted in" * bool(sticking),
    }
    told |= {"froude": _range(numbers), "inertial": _range(inertial)}
    sentence = say("on_earth" if slower == 1.0 else "follows", **told)
    return {
        "froude_numbers": numbers, "inertial_numbers": inertial, "pace": slower,
        "follow_gravity": [name for name in used if name not in given], "given": given,
        "sentence": f"{sentence}; given ones are kept as they are: {', '.join(given)}" if given else sentence,
    }  # fmt: skip


def _range(numbers: list[float]) -> str:
    low, high = (f"{number:.2g}" for number in (numbers[0], numbers[-1]))
    return low if low == high else f"{low} to {high}"


def fast_for_gravity(settings: PenetrateSettings, friction: float) -> Iterator[str]:
    """A warning for every speed, of grains with this friction, at which inertia is no small part of the force."""
    of = {"gravity": settings.gravity + _sticking(settings), "diameter": settings.tip_diameter}
    for name in SPEEDS:
        value = settings.used(name) if name != "retreat_speed" else None  # what is fitted is the way in
        if not value:
            continue
        fastest = max(value) if isinstance(value, tuple) else value
        share = inertia_share(fastest, friction=friction, **of)
        if share > FAR:
            most = quasi_static_speed(friction=friction, **of)
            numbers = {"name": name, "fastest": fastest, "most": most}
            numbers["froude"] = froude(fastest, gravity=settings.gravity, diameter=settings.tip_diameter)
            yield say("fast_for_gravity", percent=100 * share, s=settings, **numbers)
