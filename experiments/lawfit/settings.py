"""Settings of `hedgebed calibrate`."""

import math
import re
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from experiments.penetrate.settings import PenetrateSettings
from experiments.runs.reading import nearest
from experiments.runs.strict import Positive, Scheduler, Workers
from experiments.runs.units import Unit, find_unit
from vis.page.sentences import Sentences

__all__ = ["LAWS", "LawFitSettings", "say"]

say = Sentences(__package__)

LAWS = (
    "spring-damper", "hunt-crossley", "power-irreversible", "katsuragi-durian", "katsuragi-durian-added-mass",
    "bekker", "rft",
)  # fmt: skip


_OF_DESIGN = ("tips", "gravities", "loads", "unload_depths", "drag_depths", "choose_further")
_TIP = re.compile(r"(ball|sphere|flat|cone):([^:]+)(?::([0-9.]+))?")
_SHAPES = {"ball": "sphere"}
"""What a tip may also be called."""


def _tip_of(text: str) -> tuple[str, float, float]:
    """Shape, diameter [m] and cone angle [degrees] of a tip such as ball:12mm. Raises ValueError for another text."""
    found, unit = _TIP.fullmatch(text), find_unit("[m]")
    assert unit is not None
    try:
        if found is None:
            raise ValueError
        diameter = float(found[2]) if re.fullmatch(r"[0-9.]+(e-?[0-9]+)?", found[2]) else unit.value_of(found[2])
        angle = float(found[3] or 60.0)
    except ValueError:
        raise ValueError(say("bad_tip", tip=text)) from None
    if not 0 < diameter < 1 or not 1 <= angle < 180 or (found[3] and found[1] != "cone"):
        raise ValueError(say("bad_tip", tip=text))
    return _SHAPES.get(found[1], found[1]), diameter, angle


def _same(given: Any, first: Any, unit: Unit | None) -> bool:
    """Whether a setting, which may be text with a unit, equals the first of a list."""
    if isinstance(given, str) and unit is not None:
        given = unit.value_of(given)
    if isinstance(given, int | float) and isinstance(first, int | float):
        return math.isclose(given, first, rel_tol=1e-9)
    return bool(given == first)


class LawFitSettings(PenetrateSettings):
    """K and C, and rival laws, with the range in which they hold: from finished runs of penetrate, or from runs that
    are chosen and computed until the tolerance is reached.

    The settings of `penetrate` describe the runs that are computed.
    """

    # Finished runs
    runs: tuple[str, ...] = ()
    """Folders of finished runs of penetrate, or folders with such run folders (the members of a converge run)."""

    # New runs
    tip: Literal["sphere", "cone", "flat"] = Field(
        "sphere", description="Shape of the tip: sphere, cone or flat.", json_schema_extra={"as_text": True}
    )
    budget: Positive | None = None
    """Estimated time of one core for new runs [s], such as 30min; the runs are then chosen and computed."""
    tolerance: float = Field(0.1, gt=0, lt=1)
    """Relative half-width of the 90 % interval of the force at which no more runs are added [1]."""
    most_beds: int = Field(12, ge=2, le=100, description="Largest number of beds [1].")
    members: str | None = Field(None, min_length=1)
    """Folder of the computed runs, where runs of the same settings are used again; 'members' in the run's folder if not
    given."""
    workers: Workers = None
    scheduler: Scheduler = None
    tips: tuple[str, ...] = ()
    """Tips of a crossed design, such as ball:12mm, flat:16mm, cone:12mm or cone:12mm:90 (full angle in degrees). The
    settings of the runs are those of the first tip; the others have similar runs (docs/calibrate.md)."""
    gravities: tuple[Positive, ...] = ()
    """Gravities of a crossed design [m/s2], such as 1g or 0.1g. The settings of the runs are those of the first one;
    under the others speeds, times and loads follow."""
    loads: tuple[Positive, ...] = ()
    """Further loads under which the tip is set down in each bed [N]."""
    unload_depths: tuple[Positive, ...] = ()
    """Depths at which the tip is unloaded and loaded again in each bed [m]."""
    drag_depths: tuple[Positive, ...] = ()
    """Depths at which the tip is moved sideways by its diameter in each bed [m]."""
    choose_further: bool = True
    """Whether loads, unload_depths and drag_depths are chosen if none of them is given and the budget is sufficient."""
    speeds: tuple[Positive, ...] = Field(
        (0.1, 0.4), min_length=2, description="Speeds of the drives in each bed [m/s]."
    )
    drop_speeds: tuple[Positive, ...] = Field((0.15,), description="Speeds of the drops in each bed [m/s].")
    other_speeds: tuple[Positive, ...] = ()
    """Not used: every bed is driven at all of speeds [m/s]."""
    other_drop_speeds: tuple[Positive, ...] = ()
    """Not used: every bed has all drops of drop_speeds [m/s]."""
    frame_count: int = Field(0, ge=0, le=2000, description="Frames of each shown run [1]; 0 for none.")

    export: str | None = Field(None, min_length=1)
    """Folder for law.json and law.py, the best law for use without hedgebed; 'export' in the run's folder if not
    given."""

    # The fit
    laws: tuple[str, ...] = Field(LAWS, min_length=1)
    """Laws to compare beside the spring-damper: spring-damper, hunt-crossley, power-irreversible, katsuragi-durian,
    katsuragi-durian-added-mass, bekker, rft."""
    bins: int = Field(
        12,
        ge=4,
        le=200,
        description="Intervals from 0 to the largest depth of all runs, over which each run is averaged [1].",
    )
    force_error: float = Field(0.2, gt=0, lt=1, description="Largest error of the force of a valid law [1].")
    sinkage_error: float = Field(0.15, gt=0, lt=1, description="Largest error of the sinkage of a valid law [1].")

    @model_validator(mode="before")
    @classmethod
    def _first_of_each(cls, given: Any) -> Any:
        """Tip and gravity of a crossed design are the first of each list. Raises ValueError for others beside it."""
        if not isinstance(given, dict):
            return given
        found: dict[str, object] = {}
        if str(given.get("tip", "")).lower().endswith((".stl", ".obj", ".ply")):
            raise ValueError(say("tip_file", tip=given["tip"]))
        if (tips := given.get("tips")) and isinstance(tips, list | tuple):
            found |= dict(zip(("tip", "tip_diameter", "cone_angle"), _tip_of(str(tips[0])), strict=True))
        if (gravities := given.get("gravities")) and isinstance(gravities, list | tuple):
            unit, own = find_unit("[m/s2]"), gravities[0]
            assert unit is not None
            found["gravity"] = unit.value_of(own) if isinstance(own, str) else own
        for name, value in found.items():
            if name in given and not _same(given[name], value, find_unit(cls.model_fields[name].description)):
                raise ValueError(say("beside_list", key=name, value=given[name], first=value))
        return given | found

    @property
    def tip_shapes(self) -> tuple[tuple[str, float, float], ...]:
        """Shape, diameter [m] and cone angle [degrees] of each of `tips`."""
        return tuple(_tip_of(text) for text in self.tips)

    @property
    def crossed(self) -> bool:
        """Whether there is more than one tip or gravity."""
        return max(len(self.tips), len(self.gravities)) > 1

    @model_validator(mode="after")
    def _known(self) -> Self:
        for name in self.laws:
            if name not in LAWS:
                raise ValueError(f"laws = {name!r} is not known; {nearest(name, LAWS)}")
        if len(set(self.tip_shapes)) < len(self.tips) or len(set(self.gravities)) < len(self.gravities):
            raise ValueError(say("cell_twice", s=self))
        for key in ("unload_depths", "drag_depths"):
            if (deep := max(getattr(self, key), default=0.0)) > self.depth:
                raise ValueError(say("below_depth", key=key, value=deep, depth=self.depth))
        if len(set(self.runs)) < len(self.runs):
            raise ValueError(f"runs = {list(self.runs)} contains a folder twice: give each once")
        if bool(self.runs) == (self.budget is not None):
            raise ValueError(say("runs_or_budget" if not self.runs else "runs_and_budget", s=self))
        if self.ground != "bed" or self.bed is not None or self.model is not None:
            key = next(key for key in ("bed", "model", "ground") if getattr(self, key) not in (None, "bed"))
            raise ValueError(say("not_here", key=key, value=getattr(self, key)))
        if not self.set_down:
            raise ValueError(say("needs_set_down"))
        if self.runs:
            self._refuse_settings_of_runs()
        return self

    def _refuse_settings_of_runs(self) -> None:
        """Raise ValueError for a setting that finished runs already have."""
        fields = type(self).model_fields
        for name in (*PenetrateSettings.model_fields, "members", "workers", "scheduler", *_OF_DESIGN):
            if getattr(self, name) != fields[name].default:
                raise ValueError(say("of_computed_runs", key=name, value=getattr(self, name)))
