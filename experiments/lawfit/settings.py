"""Settings of `hedgebed calibrate`."""

from typing import Self

from pydantic import Field, model_validator

from experiments.runs.reading import nearest
from experiments.runs.strict import StrictSettings
from vis.page.sentences import Sentences

__all__ = ["LAWS", "LawFitSettings", "say"]

say = Sentences(__package__)

LAWS = (
    "spring-damper", "hunt-crossley", "power-irreversible", "katsuragi-durian", "katsuragi-durian-added-mass",
    "bekker", "rft",
)  # fmt: skip


class LawFitSettings(StrictSettings):
    """K and C, and rival laws, from finished runs of penetrate in one material, with the range in which they hold."""

    runs: tuple[str, ...] = Field(min_length=1)
    """Folders of finished runs of penetrate, or folders that hold such run folders (the members of a converge run)."""
    laws: tuple[str, ...] = Field(LAWS, min_length=1)
    """Laws to compare beside the spring-damper: spring-damper, hunt-crossley, power-irreversible, katsuragi-durian,
    katsuragi-durian-added-mass, bekker, rft."""
    bins: int = Field(12, ge=4, le=200, description="Intervals of depth over which each run is averaged [1].")
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
        return self
