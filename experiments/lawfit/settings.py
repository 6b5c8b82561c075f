"""Settings of `hedgebed calibrate`."""

from typing import Self

from pydantic import Field, model_validator

from experiments.penetrate.settings import PenetrateSettings
from experiments.runs.reading import nearest
from experiments.runs.strict import Positive
from vis.page.sentences import Sentences

__all__ = ["LAWS", "LawFitSettings", "say"]

say = Sentences(__package__)

LAWS = (
    "spring-damper", "hunt-crossley", "power-irreversible", "katsuragi-durian", "katsuragi-durian-added-mass",
    "bekker", "rft",
)  # fmt: skip


class LawFitSettings(PenetrateSettings):
    """K and C, and rival laws, with the range in which they hold: from finished runs of penetrate, or from runs that
    are chosen and computed until they tell enough.

    The settings of `penetrate` describe the runs that are computed.
    """

    # Runs that are there
    runs: tuple[str, ...] = ()
    """Folders of finished runs of penetrate, or folders that hold such run folders (the members of a converge run)."""

    # Runs to be computed
    budget: Positive | None = None
    """Time that one core may take for runs by their estimate [s], such as 30min; then runs are chosen and computed."""
    tolerance: float = Field(0.1, gt=0, lt=1)
    """Half of the 90 % interval of the force, over the force, at which no more runs are added [1]."""
    most_beds: int = Field(12, ge=2, le=100, description="Beds at most [1].")
    members: str | None = Field(None, min_length=1)
    """Folder where the computed runs are kept, each found again by its settings; 'members' in the run's folder if not
    given."""
    tip_diameter: Positive = Field(
        0.012, description="Diameter of the tip [m].", json_schema_extra={"option_alias": "--spike-diameter"}
    )
    speeds: tuple[Positive, ...] = Field(
        (0.1, 0.4), min_length=2, description="Speeds of the drives in each bed [m/s]."
    )
    drop_speeds: tuple[Positive, ...] = Field((0.15,), description="Speeds of the drops in each bed [m/s].")
    other_speeds: tuple[Positive, ...] = ()
    """Not used: every bed is driven at all of speeds [m/s]."""
    other_drop_speeds: tuple[Positive, ...] = ()
    """Not used: every bed has all drops of drop_speeds [m/s]."""
    frame_count: int = Field(0, ge=0, le=2000, description="Frames of each shown run [1]; 0 for none.")

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
    force_error: float = Field(0.2, gt=0, lt=1, description="Error of the force up to which a law is said to hold [1].")
    sinkage_error: float = Field(
        0.15, gt=0, lt=1, description="Error of the sinkage up to which a law is said to hold [1]."
    )

    @model_validator(mode="after")
    def _known(self) -> Self:
        for name in self.laws:
            if name not in LAWS:
                raise ValueError(f"laws = {name!r} is not known; {nearest(name, LAWS)}")
        if len(set(self.runs)) < len(self.runs):
            raise ValueError(f"runs = {list(self.runs)} holds a folder twice: each once was expected")
        if bool(self.runs) == (self.budget is not None):
            raise ValueError(say("runs_or_budget" if not self.runs else "runs_and_budget", s=self))
        if self.ground != "bed" or self.bed is not None or self.model is not None:
            key = next(key for key in ("bed", "model", "ground") if getattr(self, key) not in (None, "bed"))
            raise ValueError(say("not_here", key=key, value=getattr(self, key)))
        if self.runs:
            self._refuse_settings_of_runs()
        return self

    def _refuse_settings_of_runs(self) -> None:
        """Raise ValueError for a setting that the finished runs have decided already."""
        fields = type(self).model_fields
        for name in (*PenetrateSettings.model_fields, "members"):
            if getattr(self, name) != fields[name].default:
                raise ValueError(say("of_computed_runs", key=name, value=getattr(self, name)))
