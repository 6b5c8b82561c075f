"""A small experiment to run the command line on: it needs neither Taichi nor a bed."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from experiments.runs.folder import RunFolder
from experiments.runs.strict import StrictSettings
from rigid.checks.unfit import UnfitSettingsError

ENDINGS = {
    error.__name__: error
    for error in (KeyboardInterrupt, RuntimeError, UnfitSettingsError, ValueError, ZeroDivisionError)
}


class DigSettings(StrictSettings):
    """Stand-in settings with every kind of value that real ones have."""

    grain: Literal["sand", "glass"] = Field("sand", description="Material of the grains.")
    spike_diameter: float = Field(0.02, gt=0, description="Diameter of the spike [m].")
    drive_speeds: tuple[float, ...] = Field((0.1, 0.2), description="Speeds of the driven runs [m/s].")
    seeds: tuple[Annotated[int, Field(ge=0)], ...] = Field((1,), min_length=1, description="Seeds [1].")
    size: tuple[float, float, float] = Field((0.1, 0.1, 0.05), description="Size of the bed [m].")
    steps: int = Field(3, ge=0, description="Steps to take [1].")
    load: Annotated[float, Field(gt=0)] | None = Field(1.5, description="Load on the spike [N]; none if not set.")
    deep: bool = Field(False, description="Go deeper.")
    ending: str = Field("done", description='How it ends: "done", or the name of an error.')

    @model_validator(mode="after")
    def _fits(self):
        if self.spike_diameter > self.size[0]:
            raise ValueError(f"spike_diameter = {self.spike_diameter} m is wider than the bed: at most {self.size[0]}")
        return self


def dig(settings, folder, progress):
    run = RunFolder.ensure(folder, "dig", settings)
    ending = settings.ending if not run.is_done("first") else "done"
    if ending == "early":
        raise ValueError("time_step = 1 s is too long: at most 1e-5 s")
    progress.plan({"dig": 1.0})
    progress.stage("dig", total=settings.steps)
    run.write_series("dig", {"t_s": [0.0, 0.1], "phase": ["in", "out"]})
    run.mark_done("first")
    print("a library that writes to stdout")
    for step in range(settings.steps):
        progress.update(step + 1)
    if ending in ENDINGS:
        raise ENDINGS[ending]("a grain was lost at t = 0.1 s")
    result = {
        "format": "hedgebed-result/1",
        "experiment": "dig",
        "title": "A hole",
        "quantities": {
            "depth": {"value": 0.02, "std": 0.001, "unit": "m"},
            "count": {"value": 3, "std": float("nan"), "unit": "1"},
        },
        "departures": {"sentences": ["The hole is [deep]."]},
        "warnings": ["it is dark"],
    }
    run.write_result(result)
    return result
