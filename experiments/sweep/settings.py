"""Settings of `hedgebed sweep`: which experiment, what is fixed, what is varied, and where the runs are computed."""

from collections.abc import Mapping
from typing import Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from experiments.runs.registry import EXPERIMENTS
from experiments.runs.strict import Scheduler, SeedNumber, StrictSettings
from rigid.checks import nearest
from rigid.result import toml_value

__all__ = ["SweepSettings"]

_EXAMPLE = 'as experiment = "tumble"'


class SweepSettings(StrictSettings):
    """Runs of one experiment over lists, ranges and samples of its settings, or over the rows of a table."""

    # What is run
    experiment: str = ""
    """The experiment whose settings are varied, by its name on the command line; it must be given."""
    base: str | None = Field(None, min_length=1)
    """Case file of that experiment, or the name of one that ships, which all runs start from."""
    fixed: tuple[str, ...] = ()
    """Settings that all runs share, as KEY=VALUE; in a file also a table [fixed]."""
    over: tuple[str, ...] = ()
    """Settings that are varied, as KEY=[VALUE, VALUE] (a list), KEY=FROM:TO:STEP (a range), KEY=FROM:TO (sampled
    evenly) or KEY=FROM:TO:log (sampled evenly in the logarithm); in a file also a table [over]. Lists and ranges are
    taken in all combinations."""
    table: str | None = Field(None, min_length=1)
    """CSV file of settings: the head names them, each row is one run; it is combined with what `over` lists."""

    # What is sampled
    sampling: Literal["latin", "sobol"] = "latin"
    """How KEY=FROM:TO is sampled: a Latin hypercube, or Saltelli's design for Sobol' indices."""
    samples: int = Field(64, ge=1, le=100_000)
    """Points of the Latin hypercube [1]; of Saltelli's design its base, a power of two: it has samples x (keys + 2)
    points."""
    seed: SeedNumber = 1
    """Seed of the sampling."""
    quantities: tuple[str, ...] = ()
    """Quantities that plots and sensitivities are of, by their names in result.json; all that vary if not given."""

    # Where it is computed
    workers: int | None = Field(None, ge=1, le=1024)
    """Number of processes on this machine, each with one run at a time; 1 needs no dask; one for each core if not
    given, 1 where dask is not installed."""
    threads: int | None = Field(None, ge=1, le=1024)
    """CPU threads of each run; the cores here shared out evenly, or 1 on a cluster, if not given."""
    scheduler: Scheduler = None
    members: str | None = Field(None, min_length=1)
    """Folder of the runs, each found again by its settings, so that sweeps share them; workers elsewhere must see it
    under the same path; 'members' in the sweep's folder if not given."""
    reports: bool = False
    """Whether each run draws its own report too."""

    @field_validator("fixed", "over", mode="before")
    @classmethod
    def _of_a_table(cls, value: Any) -> Any:
        """A table of a file as the texts that the command line takes."""
        return [f"{key}={toml_value(item)}" for key, item in value.items()] if isinstance(value, Mapping) else value

    @model_validator(mode="after")
    def _complete(self) -> Self:
        known = [name for name in EXPERIMENTS if name != "sweep"]
        if not self.experiment:
            raise ValueError(f"experiment must be given, {_EXAMPLE}: one of {', '.join(known)}")
        if self.experiment not in known:
            raise ValueError(f"experiment = {self.experiment!r} cannot be swept; {nearest(self.experiment, known)}")
        if not self.over and self.table is None:
            raise ValueError("nothing is varied: give over, as over = ['torque=[0.2, 0.25]'], or table")
        if self.scheduler is not None and self.workers is not None:
            raise ValueError(f"workers = {self.workers} are processes here: leave it out beside scheduler")
        if self.sampling == "sobol" and self.samples & (self.samples - 1):
            raise ValueError(f"samples = {self.samples} is not a power of two, as sampling = 'sobol' needs, such as 64")
        return self
